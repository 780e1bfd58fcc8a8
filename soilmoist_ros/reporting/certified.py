# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The certificate of a run: in words, as a file, and made again from the folder of the run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilmoist_ros.exploration import sample_from_text
from soilmoist_ros.foundation import InputError, read_json
from soilmoist_ros.mapping import FIT_SETTINGS, FieldGrid, FieldMapSettings, Knowledge
from soilmoist_ros.pipeline import REMEDY, Certificate, certify, curve_of, run_certificate
from soilmoist_ros.recording import RECORDS, SUMMARY, read_records
from soilmoist_ros.reporting.certainty import NO_LEVEL, calibration_of, once_a_run
from soilmoist_ros.reporting.opened_run import open_run
from soilmoist_ros.reporting.output_folder import CERTIFICATE_NAME

if TYPE_CHECKING:
    from soilmoist_ros.pipeline import MapRun

_STATED = ("rate_cps", "vwc", "drift_corrected")
_WIDE = 1 / 3  # an interval of the mean whose half is a larger share of it is of little use
_SAME = 1e-6  # relative difference of two statements that are the same but for rounding in the files


@once_a_run
def certificate_of(run: MapRun) -> Certificate | None:
    """The certificate of a run, ``None`` without a sealed sample."""
    return run_certificate(run)


def statement_text(certificate: Certificate, moist: bool) -> str:
    """Mean and error in one sentence."""
    statement = certificate.vwc if moist else certificate.rate
    measured, places = len(certificate.measured), len(certificate.sample.cells)
    if statement is None:
        return f"no statement: {measured} of {places} places were counted at, or nothing else was"
    unit, factor = ("% by volume", 100.0) if moist else ("counts/s", 1.0)
    mean, half_width, rmse = (factor * one for one in (statement.mean, statement.half_width, statement.rmse))
    text = f"mean {_figure(mean, half_width)} ± {_figure(half_width)} {unit}"
    seen = f"{_figure(rmse)} {unit}" if rmse > 0 else "too small to be seen"
    limit, below = statement.rmse_below, "too few counts for an upper limit"
    if limit is not None:
        below = f"95 %: below {_figure(factor * limit)} {unit}"
    text += f" (95 %), whatever the model; RMSE of the map {seen} ({below})"
    return f"{text}; too wide to be of much use: give more time or places" if half_width > _WIDE * mean else text


def sample_text(certificate: Certificate) -> str:
    """Number of places, and the seal of the sample."""
    sample = certificate.sample
    return f"{len(certificate.measured)} of {len(sample.cells)} places, seal {sample.digest}"


def _figure(value: float, like: float | None = None) -> str:
    """A figure with two digits, or with the decimals of another one."""
    size = abs(value if like is None else like)
    decimals = 1 - math.floor(math.log10(size)) if size > 0 else 1
    return f"{value:.{min(max(decimals, 0), 4)}f}"


def certificate_text(run: MapRun) -> list[str]:
    """Sentences on the statements of a run's certificate, and on what these leave out; empty without one."""
    found = certificate_of(run)
    if found is None:
        return []
    sample, curve = found.sample, run.soil_map.curve
    measured, places = len(found.measured), len(sample.cells)
    text = statement_text(found, curve is not None)
    lost = ", ".join(sample.stops[n].name for n in range(places) if n not in found.measured)
    origin = "the level is not known at all" if calibration_of(run) in NO_LEVEL else "its uncertainty comes on top"
    stated = found.rate is not None
    sentences = {
        f"{text[:1].upper()}{text[1:]}.": True,
        f"Sample: {places} places, drawn before the mission with the seed {sample.seed} (seal {sample.digest}); "
        f"{measured if lost else 'all'} were counted at.": True,
        f"Not counted at: {lost}. The statement leaves out the part of the field that they stand for, about "
        f"{100 * (1 - measured / places):.0f} %.": stated and lost,
        "The seed does not draw this sample: do not trust the statement.": stated and not found.as_drawn,
        "The mean is of what the sensor sees from each place of the field, so ground within its reach outside the "
        "border counts too. The error is that of the map made without these places; the map here has them, too.":
        stated,
        f"The calibration (N0) is taken as it is: {origin}.": stated and curve is not None,
        f"{100 * (1 - sample.visitable):.0f} % cannot be visited, and counts as the nearest place that is.":
        stated and sample.visitable < 0.995,
        "Counts were corrected for the change of the rate that the map has found, which is a model.": found.drifts,
    }  # fmt: skip
    return [sentence for sentence, holds in sentences.items() if holds]


def certificate_content(run: MapRun) -> dict[str, Any]:
    """Sample, statements and all that is needed to make them again from the records and visits of the folder."""
    found, mission = certificate_of(run), run.mission
    assert found is not None
    assert mission is not None
    grid, settings = run.soil_map.grid, mission.settings
    return {
        **found.values, "sample": read_json(found.sample.text),
        "map": {
            "cell_m": grid.cell_m, "polygons": [grid.polygon.tolist()],
            "holes": [ring.tolist() for ring in grid.holes], "stops_only": settings.map_from == "stops",
            "knowledge": bool(run.earlier or run.covariates or settings.prior),
            "calibrated": run.soil_map.curve is not None,
            **{name: getattr(settings, name) for name in FIT_SETTINGS},
        },
    }  # fmt: skip


def check_certificate(folder: Path) -> tuple[Certificate, str]:
    """Draw the sample of a run's certificate again, and make its statements again from records and visits.

    :returns: the certificate as made again, and in a sentence what was compared, and what not
    :raises InputError: if the folder has no certificate, or seed, visits, records and files do not fit together
    """
    import json

    path, run = folder / CERTIFICATE_NAME, open_run(folder)
    if not path.is_file():
        raise InputError(f"holds no {CERTIFICATE_NAME}", "give the folder of a mission with certify", folder)
    try:
        content = read_json(path.read_bytes().decode("utf-8"))
        about = content["map"]
        sample = sample_from_text(json.dumps(content["sample"], separators=(",", ":")))
        grid = FieldGrid.from_polygon(about["polygons"][0], about["cell_m"], about["holes"])
        settings = FieldMapSettings(**{name: about[name] for name in FIT_SETTINGS})
        stops_only, knowledge = bool(about["stops_only"]), bool(about["knowledge"])
    except (LookupError, TypeError, ValueError) as error:
        raise InputError(f"cannot be read: {error!s:.200}", REMEDY, path) from None
    if not sample.is_as_drawn:
        raise InputError(f"the seed {sample.seed} does not draw this sample", "do not trust it", path)
    curve = curve_of(run.summary, folder) if about.get("calibrated") else None
    made = certify(
        sample, read_records(folder / RECORDS), run.visits, grid, settings, curve, Knowledge(), stops_only
    )
    values = made.values
    values |= {name: content.get(name) if knowledge else values.get(name) for name in _STATED}
    for file, stated in ((path, content), (folder / SUMMARY, run.summary.get("certificate") or {})):
        for name, value in values.items():
            if not _same(value, stated.get(name)):
                wrong = f"{name} of the certificate is not what seed, records and visits give"
                raise InputError(wrong, "do not trust it", file)
    compared = f"the seed draws the sample, and times of visits, {RECORDS}, {SUMMARY} and {CERTIFICATE_NAME} agree"
    if knowledge:
        compared += ", but for the statements: other surveys or covariates informed the map, replay to compare"
    return made, f"{compared}; not checked: report.html, map, pictures, counts in visits.csv, and any bag"


def _same(made: object, stated: object) -> bool:
    if isinstance(made, dict):
        return isinstance(stated, dict) and all(_same(one, stated.get(name)) for name, one in made.items())
    if isinstance(made, float) and isinstance(stated, int | float):
        return math.isclose(made, stated, rel_tol=_SAME, abs_tol=_SAME)
    return made == stated
