# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Variogram of a field as surveys of other fields expect it: empirical Bayes.

Each survey is six numbers: the logarithms of variation (standard deviation of the structured rate as a share of
the mean rate), practical range and nugget (share of the structured variance), and their standard errors. They are
what its counts say, without its prior: ``sd^2 = posterior sd^2 / (1 - share of the prior)``.

Fields of a farm scatter about a common mean. For each parameter, with the spread tau between fields::

    value of survey i ~ N(mean, sd_i^2 + tau^2),   mean ~ N(usual value, (2 usual sd)^2),   tau ~ half-Cauchy(0.5)

The mean is integrated in closed form, tau over a grid (Gelman 2006, Bayesian Analysis 1:515-534). What follows for
a field without a survey is nearly normal. This field may be unlike the others: its variogram is fitted with this
prior and with the usual one, and the evidence of the counts chooses (Kass & Raftery 1995, Journal of the American
Statistical Association 90:773-795).
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError, Mistake, read_json, read_limited
from soilmoist_ros.mapping.variogram.model import Variogram, correlation_model, mode_of

Array = NDArray[np.float64]

GUESSED_VARIATION: Final = 0.15
GUESSED_NUGGET: Final = 0.05
GUESS_LOG_SD: Final = (0.5, 1.0, 1.5)
"""Usual prior of a field: medians of variation and nugget, and standard deviations of the logarithms of
:data:`NAMES`."""
NAMES: Final = ("variation", "range_m", "nugget_share")
"""The parameters, with the units of the file; the file has the factor of one standard error behind each."""
COLUMNS: Final = ("survey", *(name for one in NAMES for name in (one, f"{one.split('_')[0]}_factor")))
_TAU: Final = np.geomspace(0.02, 2.0, 25)
_TAU_SCALE: Final = 0.5
_HIGHEST: Final = {"variation": 1.0, "range_m": 1e6, "nugget_share": 10.0}
"""Values beyond which a table is in other units."""
_MIN_NUGGET: Final = 1e-4
_MIN_LOG_SD: Final = 0.05  # least standard error of a logarithm that is believed
_MAX_LOG_SD: Final = 3.0  # standard error of a logarithm from which on the counts say nothing
_SUMMARY: Final = "summary.json"


@dataclass(frozen=True)
class FarmSurvey:
    """A survey: logarithms of :data:`NAMES`, and their standard errors, ``inf`` where it says nothing."""

    name: str
    log_values: tuple[float, float, float]
    log_sds: tuple[float, float, float]
    times_s: tuple[float, float] = (math.inf, -math.inf)
    """Begin and end of a measured survey [s since 1970-01-01 UTC]; none if it does not say."""

    @classmethod
    def of(
        cls, name: str, mode: Variogram, mean_rate: float, log_sd: Sequence[float], prior_share: Sequence[float]
    ) -> FarmSurvey:
        """A survey by the fit of its variogram.

        :param mode: posterior mode
        :param mean_rate: mean rate [counts/s], > 0
        :param log_sd: standard errors of the logarithms of structured sill, range and nugget
        :param prior_share: influence of the prior on these, 0..1
        """
        structured, nugget = mode.structured_sill, max(mode.nugget, _MIN_NUGGET * mode.structured_sill)
        values = (
            0.5 * math.log(structured / mean_rate**2),
            math.log(mode.range_m * correlation_model(mode.model).practical),
            math.log(nugget / structured),
        )
        alone = [
            sd / math.sqrt(1 - share) if share < 1 else math.inf
            for sd, share in zip(log_sd, prior_share, strict=True)
        ]
        of_nugget = math.hypot(alone[2], alone[0])  # the errors of nugget and sill are hardly correlated
        first, second, third = (
            one if one < _MAX_LOG_SD else math.inf for one in (alone[0] / 2, alone[1], of_nugget)
        )
        return cls(name, values, (first, second, third))


@dataclass(frozen=True)
class FarmPrior:
    """Surveys of other fields, one at least."""

    surveys: tuple[FarmSurvey, ...]
    left_out: int = 0
    """Number of runs that are the present survey itself."""

    def besides(self, began_s: float) -> FarmPrior | None:
        """The prior without the survey that began at this time, whose counts would be used twice [s]."""
        others = tuple(one for one in self.surveys if not one.times_s[0] <= began_s <= one.times_s[1])
        return replace(self, surveys=others, left_out=len(self.surveys) - len(others)) if others else None

    def expected(self, usual: Array, usual_sd: ArrayLike = GUESS_LOG_SD) -> tuple[Array, Array]:
        """Mean and standard deviation of the logarithms of :data:`NAMES` of a field without a survey, shape (3,).

        :param usual: means of the usual prior, shape (3,)
        :param usual_sd: its standard deviations, shape (3,)
        """
        usual_sd = np.asarray(usual_sd, float)
        values = np.array([one.log_values for one in self.surveys])
        variances = np.maximum([one.log_sds for one in self.surveys], _MIN_LOG_SD) ** 2
        means, sds = np.empty(3), np.empty(3)
        for column in range(3):
            value, wide = values[:, column], (2 * usual_sd[column]) ** 2
            total = variances[:, column] + _TAU[:, None] ** 2  # of each tau and survey
            weight = 1 / total
            precision = weight.sum(axis=1) + 1 / wide
            mean = (weight @ value + usual[column] / wide) / precision
            known = np.isfinite(total)
            misfit = np.where(known, weight * (value - mean[:, None]) ** 2, 0.0).sum(axis=1)
            misfit += (mean - usual[column]) ** 2 / wide
            spread = np.where(known, np.log(np.where(known, total, 1.0)), 0.0).sum(axis=1) + np.log(precision)
            height = -0.5 * (misfit + spread) - np.log1p((_TAU / _TAU_SCALE) ** 2) + np.log(_TAU)
            share = np.exp(height - height.max())
            share /= share.sum()
            means[column] = share @ mean
            sds[column] = math.sqrt(share @ (1 / precision + _TAU**2 + (mean - means[column]) ** 2))
        return means, np.minimum(sds, usual_sd)

    @property
    def text(self) -> str:
        """Variation, range and nugget expected of another field, in words; a factor is one standard deviation."""
        range_m = float(np.mean([one.log_values[1] for one in self.surveys]))
        mean, sd = self.expected(np.array([math.log(GUESSED_VARIATION), range_m, math.log(GUESSED_NUGGET)]))
        variation, extent, nugget = (
            f"{value:{form}} (factor {factor:.1f})"
            for value, factor, form in zip(np.exp(mean), np.exp(sd), (".0%", ".0f", ".0%"), strict=True)
        )
        count = len(self.surveys)
        left_out = f", {self.left_out} left out that is this survey itself" if self.left_out else ""
        about = f"variation {variation}, range [m] {extent}, nugget {nugget}"
        return f"{count} survey{'s'[: count > 1]}{left_out}: {about}"

    def table(self) -> str:
        """The surveys as CSV, which :meth:`read` reads."""
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for one in self.surveys:
            texts = [
                (f"{min(math.exp(value), _HIGHEST[name]):.5g}", f"{math.exp(sd):.5g}" if sd < _MAX_LOG_SD else "")
                for name, value, sd in zip(NAMES, one.log_values, one.log_sds, strict=True)
            ]
            writer.writerow([one.name, *(text for pair in texts for text in pair)])
        return stream.getvalue()

    @classmethod
    def named(cls, path: str | None) -> FarmPrior | None:
        """The surveys of :meth:`read`; ``None`` for an empty path and for ``none``."""
        return cls.read(Path(path).expanduser()) if path and path != "none" else None

    @classmethod
    def read(cls, path: Path) -> FarmPrior:
        """Surveys of a table, of the output folder of a run, or of all runs and tables in a folder.

        :raises InputError: if there is none, or one cannot be used
        """
        if path.is_dir():
            runs = sorted({path / _SUMMARY, *path.glob(f"*/{_SUMMARY}")})
            found = [survey for file in runs if file.is_file() for survey in _of_summary(file)]
            tables = (file for file in sorted(path.glob("*.csv")) if set(_rows(file)[0]) >= set(COLUMNS))
            found += [one for file in tables for one in _of_table(file)]
            why = "has neither a run with a fitted variogram (method reml) nor a table of surveys"
        else:
            found, why = _of_table(path), "lists no survey"
        if not found:
            remedy = "give the folder with the output folders of surveys of other fields, or a table of them"
            raise InputError(why, remedy, path)
        return cls(tuple({(one.log_values, one.log_sds): one for one in found}.values()))


def _of_summary(path: Path) -> Iterable[FarmSurvey]:
    """The survey of a run; none without a map, or with a variogram that was not fitted by its likelihood."""
    try:
        about: Any = read_json(read_limited(path))
        fit, model = about["fit"] or {}, about["variogram"]
        if fit.get("method") != "reml" or fit.get("log_sd") is None:
            return []
        names = ("structured_sill", "range", "nugget")
        log_sd, shares = ([float(fit[key][name]) for name in names] for key in ("log_sd", "prior_share"))
        nugget, range_m, sill = (float(model[key]) for key in ("nugget_cps2", "range_m", "sill_cps2"))
        means = Variogram(model["model"], nugget, range_m, sill)
        mode = mode_of(means, (log_sd[0], log_sd[1], log_sd[2]))
        one = FarmSurvey.of(path.parent.name, mode, float(model["mean_rate_cps"]), log_sd, shares)
        times = about.get("first_stamp_s"), about.get("last_stamp_s")
        known = not about.get("simulated") and None not in times
        return [replace(one, times_s=(float(times[0]), float(times[1]))) if known else one]
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"is not the summary of a run: {error}", "make the run again, or leave it out", path
        ) from None


def _rows(path: Path) -> list[list[str]]:
    """The cells of a table with commas, or semicolons or tabs, and perhaps decimal commas; one row at least."""
    lines = read_limited(path).decode("utf-8-sig", "replace").splitlines() or [""]
    mark = max(",;\t", key=lines[0].count)
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=mark) if row] or [[]]
    return rows if mark == "," else [rows[0], *([cell.replace(",", ".") for cell in row] for row in rows[1:])]


def _of_table(path: Path) -> list[FarmSurvey]:
    head, *rows = _rows(path)
    if missing := [name for name in COLUMNS if name not in head]:
        raise InputError(
            f"is not a table of surveys: it has no column {missing[0]!r}",
            f"its first line must name {', '.join(COLUMNS)}, as soilmoist export --to prior writes them",
            path,
        )
    found = []
    for number, row in enumerate(rows, 2):
        cells = dict(zip(head, row, strict=False))
        logs = [
            math.log(_number(cells.get(column, ""), column, number, path))
            for column in COLUMNS
            if column != "survey"
        ]
        found.append(FarmSurvey(cells.get("survey", ""), (logs[0], logs[2], logs[4]), (logs[1], logs[3], logs[5])))
    return found


def _number(cell: str, column: str, line: int, path: Path) -> float:
    """A value or factor of a table, as far as it can be; ``inf`` for a factor that is not known."""
    low, high = (1.0, math.inf) if column.endswith("_factor") else (0.0, _HIGHEST[column])
    try:
        value = float(cell) if cell or high < math.inf else math.inf
    except ValueError:
        value = math.nan
    if not (low <= value <= high and value > 0):
        what = "1 or more, or empty" if low else f"above 0 and at most {high:g}; write 0.30 for 30 %"
        raise InputError([Mistake(f"{column} is {cell!r}", f"give a number that is {what}", path, line)])
    return value
