# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Forecasts of the map's standard deviation while a mission goes on.

The kriging variance depends on places and exposures, not on the counts. If further counting of T seconds were
spread evenly over g cells, each would have noise ``n_g = g rate_g / T``. With the posterior covariance C, the
diagonal D of ``g rate_g`` and the eigenvalues l and eigenvectors U of ``D^-1/2 C D^-1/2``, the integrated variance
would be::

    IV(T) = sum_i a_i l_i / (1 + T l_i),    a_i = sum_g omega_g D_g U_gi^2

One decomposition gives the curve for all T. Two constants, fitted to simulated missions
(``scripts/bench_missions.py forecasts``), lead to a mission: a second of a plan is worth :data:`EFFICIENCY` s of
even counting, and the standard deviation falls by a further power of the counting time with the variogram known.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from soilmoist_ros.exploration.planning.decision import EXPLORING, threshold_text
from soilmoist_ros.exploration.planning.properties import MIN_RATE_CPS, Aim, Property, slope2
from soilmoist_ros.foundation import read_json
from soilmoist_ros.mapping import Prior, Variogram, VariogramFit, correlation_model, sample_correlation

Array = NDArray[np.float64]

SOON_S = 600.0  # time ahead for which a gain is stated [s]
DECIDED = 0.01
"""Share of the field expected in the wrong zone below which the decision is made: no count could change much."""


@dataclass(frozen=True, slots=True)
class Reaching:
    """When the aim of a mission is met. Figures are in its unit: m^3/m^3, shares of the rate, probabilities."""

    aim: str  # as :meth:`Aim.parse` reads it
    moisture: bool  # whether it is of the moisture
    now: float  # figure of the map now
    end: tuple[float, float, float]  # figure at the end of the mission, and its better and worse limit
    times_s: tuple[float | None, ...]
    """Time from now at which it is met, soonest and latest [s]; ``None``: too late; empty: not known yet."""

    @property
    def is_met(self) -> bool:
        """True if the map is good enough now."""
        return Aim.parse(self.aim).met(self.now)

    @property
    def met_text(self) -> str:
        """The figure now and the one demanded, in words."""
        aim = Aim.parse(self.aim)
        return f"{self._said(self.now)} {self._about(aim)}, {self._demanded(aim)} demanded"

    @property
    def text(self) -> str:
        """When the aim is met, or by how much it is missed, in words."""
        aim = Aim.parse(self.aim)
        about = f"{self._demanded(aim)} {self._about(aim)}"
        if self.is_met:
            return f"{about}: reached"
        if not self.times_s:
            return f"{about}: when is not known yet"
        when_s, soonest_s, latest_s = self.times_s
        if when_s is None:
            side = "too little" if aim.kind == "zone" else "too much"
            lack = f"{100 * abs(self.end[0] - aim.value):.1f} percentage points {side}"
            if self.end[1] == self.end[2]:
                return f"{about}: missed, {self._said(self.end[0])}, {lack}"
            low, high = (self._said(value).strip("±% ") for value in sorted(self.end[1:]))
            when = "cannot be reached in the time" if soonest_s is None else "probably not within the time"
            return f"{about} {when}: {self._said(self.end[0])} ({low} to {high}) at its end, {lack}"
        latest = "later than the time allows" if latest_s is None else f"{latest_s / 60:.0f}"
        assert soonest_s is not None
        return f"{about} in {when_s / 60:.0f} min ({soonest_s / 60:.0f} to {latest})"

    def _said(self, value: float) -> str:
        return f"{100 * value:.1f} %" if self.aim.startswith("zone") else f"±{hundredths(value)} %"

    def _demanded(self, aim: Aim) -> str:
        return f"{100 * aim.value:.3g} %" if aim.kind == "zone" else self._said(aim.value)

    def _about(self, aim: Aim) -> str:
        if aim.kind == "zone":
            return "of the zones right"
        unit = "by volume" if self.moisture else "of the rate"
        return f"{unit} on 95 % of the field" if aim.kind == "p95-sd" else f"{unit} on the mean of the field"


@dataclass(frozen=True, slots=True)
class Forecast:
    """Standard deviation of the map now and later: the root of its mean variance over the field, nugget included.

    Standard deviations of a rate map are shares of the mean rate [-], of a moisture map water contents [m^3/m^3].

    :param factors: bands about them: in four of five missions the standard deviation ends up between
        ``sd / factor`` and ``sd * factor``
    """

    sd: float  # now
    times_s: tuple[float, ...]  # times from now, rising; the last is the end of the mission [s]; none at the end
    sds: tuple[float, ...]  # at these times, if the mission goes on
    factors: tuple[float, ...]
    sd_soon: float  # after :data:`SOON_S`, if the mission goes on
    mean_rate_cps: float  # mean rate of the map [counts/s]
    moisture: bool = False  # whether the standard deviations are of the moisture
    is_guess: bool = False  # whether it is made before there is a map
    wrong: float | None = None  # share of the field expected in the wrong zone now; ``None`` without thresholds
    wrong_end: float | None = None  # at the end of the mission
    outside: tuple[float, ...] = ()  # thresholds that hardly any place of the field is below, or above
    divides: bool = True  # whether another threshold is of the field, so that there is something to decide
    reaching: Reaching | None = None  # when the mission's aim is met; ``None`` without an aim

    @property
    def gain(self) -> float:
        """Share by which the standard deviation falls in the next :data:`SOON_S`."""
        return 1 - self.sd_soon / self.sd if self.sd > 0 else 0.0

    @property
    def sd_end(self) -> float:
        """Standard deviation at the end of the mission."""
        return self.sds[-1] if self.sds else self.sd

    @property
    def band_end(self) -> tuple[float, float]:
        """Band of the standard deviation at the end of the mission."""
        return self.sd_end / self._factor_end, self.sd_end * self._factor_end

    @property
    def _factor_end(self) -> float:
        return self.factors[-1] if self.factors else 1.0

    @property
    def unit(self) -> str:
        """Unit of a hundredth of the standard deviations, in words."""
        return "% by volume" if self.moisture else "% of the rate"

    @property
    def text(self) -> str:
        """The forecast in words, as ``±2.4 % of the rate now, ±2.0 % (1.7 to 2.4) in 35 min``."""
        text = f"±{hundredths(self.sd)} {self.unit} now"
        if self.times_s:
            text += f", {self.end_text} in {self.times_s[-1] / 60:.0f} min"
        if self.wrong is not None:
            text += f"; {self.wrong_text}"
        return text if self.reaching is None else f"{text}; {self.reaching.text}"

    @property
    def end_text(self) -> str:
        """Standard deviation and band at the end of the mission, as ``±2.0 % (1.7 to 2.4)``."""
        low, high = map(hundredths, self.band_end)
        return f"±{hundredths(self.sd_end)} % ({low} to {high})"

    @property
    def wrong_ends(self) -> tuple[float, float, float] | None:
        """Share in the wrong zone at the end, and its band: that of the standard deviation, which fits."""
        factor, end = self._factor_end, self.wrong_end  # 21 of 24 missions, from half way
        return None if end is None else (end, end / factor, min(end * factor, 1.0))

    @property
    def wrong_text(self) -> str:
        """Share in the wrong zone, as ``12 % of the field in the wrong zone, 7 % (6 to 9) at the end``."""
        assert self.wrong is not None
        text = f"{100 * self.wrong:.1f} % of the field in the wrong zone"
        if self.wrong_ends is not None:
            end, low, high = (f"{100 * share:.1f}" for share in self.wrong_ends)
            text += f", {end} % ({low} to {high}) at the end"
        outside = " and ".join(map(threshold_text, self.outside))
        return f"{text}; {outside} is outside what the field has" if outside else text

    @property
    def is_decided(self) -> bool:
        """True if hardly any place is expected in the wrong zone, and a threshold divides the field."""
        return self.wrong is not None and self.wrong < DECIDED and self.divides


def hundredths(sd: float) -> str:
    """A standard deviation in hundredths, to two digits."""
    return f"{100 * sd:.{1 if sd < 0.0995 else 0}f}"


def forecast_to_text(forecast: Forecast | None) -> str:
    """A forecast as JSON, to four digits; empty without one."""
    return "" if forecast is None else json.dumps(_rounded(asdict(forecast)), separators=(",", ":"))


def forecast_from_text(text: str) -> Forecast | None:
    """The forecast that :func:`forecast_to_text` wrote.

    :raises ValueError: if the text is not one
    """
    if not text:
        return None
    try:
        found = _adapter().validate_python(read_json(text))
        if len({len(values) for values in (found.times_s, found.sds, found.factors)}) > 1:
            raise ValueError("its lists differ in length")
    except (ValueError, OverflowError) as error:
        raise ValueError(f"{text[:40]!r} is not a forecast: {error}") from None
    return found


@cache
def _adapter() -> TypeAdapter[Forecast]:
    return TypeAdapter(Forecast)


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value


# Making forecasts -----------------------------------------------------------------------------------------------

MAX_CELLS = 100  # approximate number of cells that represent the field
EFFICIENCY = 0.7  # even counting time that a second of a plan is worth [-]
LEARNING = 0.08
"""Power of the counting time by which the standard deviation falls because the variogram becomes certain [-]."""
MIN_EVERY_S = 60.0  # shortest mission time between two forecasts [s]
MAX_FORECASTS = 60  # number of forecasts in a long mission
SPREAD, MAX_SPREAD = 2.2, 1.4
"""Band in which 80 % of missions end: where the exposure grows e^x-fold, the logarithm of its factor is
``x / (2.2 + 1.4 x)``. Fitted to 168 missions, 72 of them on fields that the project did not make."""
PERSON_SPREAD, PERSON_MAX_SPREAD = 1.7, 1.75
"""The same for a person, who pauses and chooses stops: wider near the end. Fitted to 144 simulated missions."""
_STEPS, _AIM_STEPS = 8, 25
_PRIOR_EXPOSURE_S = 120.0
_MIN_SHARE = 0.05


class Forecaster:
    """Makes the forecasts of a mission, at most one per :data:`MIN_EVERY_S`.

    :param cells_xy: cells that represent the field, shape (g, 2) [m]; ``extent_m`` is that of the field
    :param nominal_rate_cps: rate to expect before there is a map [counts/s]
    """

    def __init__(self, cells_xy: Array, extent_m: float, nominal_rate_cps: float) -> None:
        self._cells_xy, self._extent_m, self._nominal_rate_cps = cells_xy, extent_m, nominal_rate_cps
        self._due_s = -math.inf

    def forecast(
        self,
        of: Property,
        used_s: float,
        left_s: float,
        robots: int = 1,
        aim: Aim | None = None,
        by_person: bool = False,
    ) -> Forecast | None:
        """The forecast now; ``None`` if the last one is recent.

        :param of: what is mapped, by a number of robots
        :param used_s: mission time used [s]; ``left_s`` is left for measuring
        """
        if used_s < self._due_s or left_s <= 0:
            return None
        every_s = max(MIN_EVERY_S, (used_s + left_s) / MAX_FORECASTS)
        self._due_s = used_s + (every_s if aim is None else MIN_EVERY_S)
        if of.field_map.soil_map is None:
            return self.before(of, left_s, aim)
        counted_s = float(of.field_map.samples.exposure_s.sum()) * of.factor
        share = min(max(counted_s / used_s, _MIN_SHARE), robots) if used_s > 0 else 1.0
        if early := used_s < EXPLORING * (used_s + left_s):
            of = replace(of, thresholds=None)
        found = map_forecast(of, self._cells_xy, left_s, share, aim, by_person)
        if early and aim is not None and aim.kind == "zone" and (reaching := found.reaching) is not None:
            end = (reaching.now,) * 3  # the end was less certain by 8 percentage points than forecast so early
            found = replace(found, reaching=replace(reaching, end=end, times_s=()))
        return found

    def before(self, of: Property, left_s: float, aim: Aim | None = None) -> Forecast:
        """The forecast for a time left for measuring [s], before there is a map."""
        expected = of.field_map.expected_fit
        rate_cps = self._nominal_rate_cps if expected is None else expected.mean_rate
        slope = None if of.curve is None else math.sqrt(float(of.curve.weight([rate_cps])[0]))
        return prior_forecast(self._cells_xy, self._extent_m, rate_cps, left_s, slope, expected, aim)

    def achieved(self, of: Property, aim: Aim | None = None) -> Forecast | None:
        """Standard deviation of the map now, ``None`` without a map."""
        return None if of.field_map.soil_map is None else map_forecast(of, self._cells_xy, 0.0, aim=aim)


def map_forecast(
    of: Property,
    cells_xy: Array,
    left_s: float,
    share: float = 1.0,
    aim: Aim | None = None,
    by_person: bool = False,
) -> Forecast:
    """Forecast from the map of a property.

    :param left_s: mission time left for measuring [s]; 0: the map as it is
    :param share: counting time per mission time [-]
    """
    kriging = of.field_map.kriging
    assert kriging is not None
    rate, variance = kriging.predict(cells_xy)
    mean, rate = max(float(rate.mean()), MIN_RATE_CPS), np.maximum(rate, MIN_RATE_CPS)
    covariance = kriging.covariance(cells_xy)
    fixed = np.maximum(variance - np.diag(covariance), 0.0)  # the nugget: counting does not lower it
    counted_s = float(of.field_map.samples.exposure_s.sum()) * of.factor
    curve = _Curve(covariance, slope2(of, rate), of.factor * rate, fixed, counted_s, share, by_person)
    reaching = None if aim is None else curve.reaching(aim, rate, left_s, of.curve is not None)
    found = replace(curve.forecast(left_s, mean, of.curve is not None), reaching=reaching)
    if of.thresholds is None:
        return found
    moved = np.clip(np.diag(covariance), 0.0, variance) * max(1 - (found.sd_end / found.sd) ** 2, 0.0)
    end = of.thresholds.wrong(rate, variance, moved) if left_s > 0 else None
    outside = of.thresholds.outside(rate, variance)
    wrong, divides = of.thresholds.wrong(rate, variance), len(outside) < len(of.thresholds.values)
    return replace(found, wrong=wrong, wrong_end=end, outside=outside, divides=divides)


def prior_forecast(
    cells_xy: Array,
    extent_m: float,
    rate_cps: float,
    left_s: float,
    slope: float | None = None,
    expected: VariogramFit | None = None,
    aim: Aim | None = None,
) -> Forecast:
    """Forecast before there is a map, for a field that varies as the prior of the variogram guesses.

    :param left_s: mission time left for measuring, > 0 [s]
    :param slope: that of the calibration at this rate, for the moisture [m^3/m^3 per count/s]
    :param expected: variogram and prior from earlier surveys, instead of the guess
    """
    prior = None if expected is None else expected.prior
    if expected is None:
        sill, nugget = (Prior.GUESSED_VARIATION * rate_cps) ** 2, Prior.GUESSED_NUGGET
        range_m = extent_m / 3 / correlation_model("matern32").practical
        variogram = Variogram("matern32", nugget * sill, range_m, (1 + nugget) * sill)
    else:
        variogram = expected.variogram
    covariance = (sample_correlation(variogram, cells_xy) + 1) * variogram.structured_sill  # the mean is unknown
    if prior is not None:
        at = prior.at(cells_xy)
        covariance += prior.covariance(at, at)
    rate = np.full(len(cells_xy), rate_cps)
    weight = np.full(len(rate), 1 / rate_cps**2 if slope is None else slope**2)
    found = _Curve(covariance, weight, rate, np.full(len(rate), variogram.nugget), _PRIOR_EXPOSURE_S, 1.0)
    made = replace(found.forecast(left_s, rate_cps, slope is not None), is_guess=True)
    if aim is None:
        return made
    if aim.kind == "zone":  # which places are dry and wet, only a map can show
        return replace(made, reaching=Reaching(str(aim), slope is not None, 0.0, (0.0, 0.0, 0.0), ()))
    return replace(made, reaching=found.reaching(aim, rate, left_s, slope is not None))


class _Curve:
    """Standard deviation against further counting time."""

    def __init__(
        self,
        covariance: Array,
        weight: Array,
        noise: Array,
        fixed: Array,
        counted_s: float,
        share: float,
        by_person: bool = False,
    ) -> None:
        root = np.sqrt(len(noise) * noise)
        values, vectors = np.linalg.eigh(covariance / root / root[:, None])
        self._values = np.maximum(values, 0.0)
        self._weight, self._shares = weight, root[:, None] ** 2 * vectors**2
        self._parts = (weight / len(noise)) @ self._shares * self._values
        self._each_fixed, self._fixed = fixed, float(weight @ fixed) / len(noise)
        self._spread = (PERSON_SPREAD, PERSON_MAX_SPREAD) if by_person else (SPREAD, MAX_SPREAD)
        self._counted_s, self._share = counted_s, share

    def sd(self, after_s: float) -> float:
        """Standard deviation after some mission time [s]."""
        even_s = EFFICIENCY * self._share * after_s
        variance = self._fixed + float((self._parts / (1 + even_s * self._values)).sum())
        return float(math.sqrt(variance) * self._growth(after_s) ** -LEARNING)

    def reaching(self, aim: Aim, rate: Array, left_s: float, moisture: bool) -> Reaching:
        """When an aim is met within the time left [s]."""
        times_s = np.linspace(0.0, left_s, _AIM_STEPS)
        now = self._variance(0.0)

        def figures(power: float) -> Array:
            made = ((self._variance(s), self._factor(s) ** (2 * power)) for s in times_s.tolist())
            return np.array([aim.figure(rate, now, self._weight, factor * later) for later, factor in made])

        middle, better, worse = (figures(power) for power in (0.0, -1.0, 1.0))
        found = tuple(_first(aim, each, times_s) for each in (middle, better, worse))
        return Reaching(str(aim), moisture, float(middle[0]), (middle[-1], better[-1], worse[-1]), found)

    def _variance(self, after_s: float) -> Array:
        """Variance of each cell after some mission time [(counts/s)^2]."""
        even_s = EFFICIENCY * self._share * after_s
        cells = self._shares @ (self._values / (1 + even_s * self._values))
        return np.asarray((self._each_fixed + cells) * self._growth(after_s) ** (-2 * LEARNING))

    def _factor(self, after_s: float) -> float:
        """Band about the standard deviation after some mission time."""
        growth, (spread, most) = math.log(self._growth(after_s)), self._spread
        return math.exp(growth / (spread + most * growth))

    def _growth(self, after_s: float) -> float:
        """Exposure of the map after some mission time [s], divided by that now."""
        return 1 + self._share * after_s / max(self._counted_s, 1.0)

    def forecast(self, left_s: float, mean_rate_cps: float, moisture: bool) -> Forecast:
        """The forecast over the time left [s]."""
        steps = range(1, _STEPS + 1) if left_s > 0 else ()
        times_s = tuple(left_s * step / _STEPS for step in steps)
        sds, factors = tuple(map(self.sd, times_s)), tuple(map(self._factor, times_s))
        return Forecast(self.sd(0.0), times_s, sds, factors, self.sd(SOON_S), mean_rate_cps, moisture)


def _first(aim: Aim, figures: Array, times_s: Array) -> float | None:
    """Time from which on all figures are good enough [s], ``None`` if the last one is not."""
    short = (figures - aim.value) * (-1.0 if aim.kind == "zone" else 1.0)
    last = np.flatnonzero(short > 0).max(initial=-1)
    if last < 0 or last + 1 == len(short):
        return 0.0 if last < 0 else None
    return float(np.interp(0.0, short[[last + 1, last]], times_s[[last + 1, last]]))
