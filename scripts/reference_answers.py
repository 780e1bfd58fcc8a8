# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Largest differences from answers that other programs computed: kriging, variogram, corrections, soil moisture.

usage: .venv/bin/python scripts/reference_answers.py [--save]

The answers are in test/data/, or are computed by crnpy here. The tests hold limits; this prints what is reached.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import results
from crnpy import crnpy
from numpy.typing import ArrayLike

from soilmoist_ros.mapping import PoissonKriging, Variogram, empirical_semivariogram
from soilmoist_ros.sensing import CalibrationCurve, Site, process_logs, read_log
from soilmoist_ros.sensing.corrections.factors import Corrections, absolute_humidity_gm3, f_road
from soilmoist_ros.sensing.moisture.curve import UniversalCurve
from soilmoist_ros.sensing.moisture.footprint import Footprint, pressure_scale, vegetation_scale

DATA = Path(__file__).resolve().parent.parent / "test" / "data"
EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
Row = tuple[str, str, str, str]


def row(what: str, source: str, ours: ArrayLike, theirs: ArrayLike, unit: str = "") -> Row:
    """Largest difference of all answers, in a unit, or relative without one."""
    found, expected = np.asarray(ours, float).ravel(), np.asarray(theirs, float).ravel()
    largest = float(np.max(np.abs(found - expected) / (1 if unit else np.abs(expected))))
    return what, source, f"{len(found)}", f"{largest:.0e} {unit or 'relative'}" if largest else "none"


def read(name: str) -> Any:
    """Answers of a file."""
    return json.loads((DATA / name).read_text(encoding="utf-8"))


def kriging() -> Iterator[Row]:
    """Systems solved with 50 digits."""
    data = read("poisson_kriging_cases.json")
    source = "50-digit arithmetic, `poisson_kriging_cases.json`"
    parameters = [float(data[key]) for key in ("nugget_p0", "range_p1", "sill_p2")]
    found: dict[str, list[tuple[ArrayLike, ArrayLike]]] = {"weights": [], "mean": [], "variance": []}
    for case in data["cases"]:
        one = PoissonKriging(Variogram(case["model"], *parameters), keep_nugget=not case["nugget_filtered"])
        one.fit(data["points"], data["counts"], data["t"])
        rate, variance = one.predict([case["target"]])
        ours = {"weights": one.weights([case["target"]])[0][:, 0], "mean": rate, "variance": variance}
        for name, pairs in found.items():
            pairs.append((ours[name], np.array(case[name], float)))
    for name, what, unit in (
        ("weights", "Poisson kriging, weights of the samples", "of 1"),
        ("mean", "Poisson kriging, rate", "counts/s"),
        ("variance", "Poisson kriging, variance of the rate", "(counts/s)²"),
    ):
        ours, theirs = (
            np.concatenate([np.atleast_1d(side) for side in sides]) for sides in zip(*found[name], strict=True)
        )
        yield row(what, source, ours, theirs, unit)
    case = read("variogram30.json")
    _, gamma, _ = empirical_semivariogram(case["points"], case["counts"], case["t"], case["edges"])
    yield row(
        "weighted semivariogram of counts",
        "`variogram30.json`",
        gamma,
        [float(one["gamma"]) for one in case["bins"]],
    )


def neptoon() -> Iterator[Row]:
    """Answers of neptoon."""
    data: Mapping[str, Any] = read("crns_reference.json")
    found = re.search(r"neptoon ([\d.]+)", data["note"])
    assert found is not None
    source = f"neptoon {found[1]}, `crns_reference.json`"
    standard = pressure_scale(1013.25)
    rows = data["universal"]["rows"]
    ours = [
        UniversalCurve(1.0, density, water, humidity_gm3=humidity, parameter_set=name).rate_cps(vwc)
        for name, vwc, humidity, density, water, _ in rows
    ]
    yield row("universal curve, rate, all parameter sets", source, ours, [one[-1] for one in rows])
    rows = data["horizontal"]["rows"]
    ours = [float(Footprint(water, humidity).weight(scaled * standard)) for scaled, water, humidity, _ in rows]
    yield row("weight of a soil core by its distance", source, ours, [one[-1] for one in rows])
    rows = data["depth"]["rows"]
    ours = [float(Footprint(water).depth_at_cm(scaled * standard, density)) for scaled, density, water, _ in rows]
    yield row("depth that is sensed", source, ours, [one[-1] for one in rows])
    rows = data["scaled_distance"]["rows"]
    ours = [at / (pressure_scale(hpa) * vegetation_scale(high, water)) for at, hpa, high, water, _ in rows]
    yield row("rescaled distance", source, ours, [one[-1] for one in rows])
    rows = [one for one in data["radius"]["rows"] if 0.1 <= one[0] <= 0.3]
    ours = [Footprint(water, humidity).radius_m for water, humidity, _ in rows]
    table = "table of Schrön et al. (2017) in whole metres"
    yield row("radius R86, 0.1 to 0.3 m³/m³", table, ours, [one[-1] for one in rows])


def formulas() -> Iterator[Row]:
    """Formulas of crnpy at many values."""
    source = f"crnpy {version('crnpy')}"
    rate = np.linspace(2.4, 6.0, 50)
    curve = CalibrationCurve(6.0, 1.4, lattice_water=0.03, organic_water=0.01)
    theirs = crnpy.counts_to_vwc(rate, N0=6.0, Wlat=0.03, Wsoc=0.01, bulk_density=1.4)
    yield row("Desilets' curve, moisture", source, curve.vwc(rate), theirs)
    counts, dry = np.linspace(90.0, 190.0, 20), CalibrationCurve(200.0, 1.4)
    theirs = crnpy.uncertainty_vwc(counts, N0=200.0, bulk_density=1.4)
    yield row(
        "its standard deviation of third order", source, dry.vwc_sd(counts, np.sqrt(counts), order=3), theirs
    )
    weather = list(product(np.linspace(600, 1080, 7), np.linspace(-20, 40, 7), np.linspace(0.05, 1, 5)))
    ours = Corrections(beta_per_hpa=1 / 130, reference_pressure_hpa=980.0, reference_humidity_gm3=5.0)
    theirs = [1 / crnpy.correction_pressure(hpa, Pref=980.0, L=130.0) for hpa, _, _ in weather]
    yield row("pressure factor", source, [ours.f_pressure(hpa) for hpa, _, _ in weather], theirs)
    theirs = [crnpy.abs_humidity(100 * share, degc) for _, degc, share in weather]
    humidities = [absolute_humidity_gm3(degc, share) for _, degc, share in weather]
    yield row("absolute humidity", source, humidities, theirs)
    factors = [ours.f_humidity(degc, share) for _, degc, share in weather]
    yield row("humidity factor", source, factors, [crnpy.correction_humidity(one, Aref=5.0) for one in theirs])
    roads = list(product((0.0, 3.0, 6.0), (0.07, 0.12), (0.15, 0.35), (0.0, 2.0, 12.0)))
    theirs = [float(crnpy.correction_road(1.0, field, width, at, road)) for width, road, field, at in roads]
    yield row("road factor", source, [f_road(width, road, field, at) for width, road, field, at in roads], theirs)


def records() -> Iterator[Row]:
    """Corrected counts of a public roving record."""
    log = read_log(EXAMPLES / "rover_gypsum_transect_2018-05-01.KSU", "hydroinnova_rover", "west")
    corrections = {"pressure": {"beta_per_hpa": 1 / 130, "reference_hpa": 976.0}, "humidity": {}}
    survey = process_logs([log], Site.model_validate({"longitude": "west", "corrections": corrections}))
    theirs = [
        sum(raw.tube_counts)
        / crnpy.correction_pressure(raw.pressure_hpa, 976.0, 130.0)
        * crnpy.correction_humidity(crnpy.abs_humidity(100 * raw.relative_humidity, raw.temperature_degc), 0.0)
        for raw in log.records
        if raw.position is not None
    ]
    ours = [one.corrected_rate * one.exposure_s for one in survey.records]
    yield row("corrected counts of the public roving record", f"crnpy {version('crnpy')}", ours, theirs)


def main() -> None:
    given = results.parser(__doc__).parse_args()
    rows = [*kriging(), *neptoon(), *formulas(), *records()]
    columns = ("what", "reference", "answers", "largest difference")
    results.publish("reference_answers", columns, rows, "files are in test/data/", given.save)


if __name__ == "__main__":
    main()
