#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Measures how often the true moisture lies below ``vwc_p05`` and above ``vwc_p95``: 5 % each would be exact.

usage: .venv/bin/python scripts/tail_coverage.py [--seeds 20] [--fields rough patches] [--samples 40]
       [--save]

Each survey has samples at random places of one surrogate field, drawn anew for each seed, all of one dwell. The
low rates are a tenth of the field's: a sensor of one tube.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import results
from numpy.typing import NDArray

from soilmoist_ros.mapping import FieldGrid, FieldMap, FieldMapSettings, Samples
from soilmoist_ros.mapping.soil_map import QUANTILE_SD, SoilMap, possible_moisture
from soilmoist_ros.reporting.page.statistics import mean_moisture
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, MoistureCurve
from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField

FIELDS = ("synthetic-high", "rough", "patches")
DWELLS_S = (10.0, 60.0, 600.0)
SHARES = (1.0, 0.1)
CELLS = 800
_CURVE = CalibrationCurve(6.0, 1.4)


class Misses(NamedTuple):
    """Misses of one survey.

    :param below: share of the cells whose truth lies below ``vwc_p05``
    :param above: share of the cells whose truth lies above ``vwc_p95``
    :param symmetric_below: likewise for ``vwc - 1.645 vwc_sd``
    :param symmetric_above: likewise for ``vwc + 1.645 vwc_sd``
    :param mean_error: mean moisture of the field minus the true one [m^3/m^3]
    :param mean_covered: whether the interval of the mean contains it
    """

    below: float
    above: float
    symmetric_below: float
    symmetric_above: float
    mean_error: float
    mean_covered: float


def survey(
    field: SurrogateField,
    samples: int,
    dwell_s: float,
    share: float,
    rng: np.random.Generator,
) -> Misses:
    """Map samples of one dwell at random places, and compare the moisture with the truth.

    :param share: rates are this share of the field's
    """
    grid = coarse_grid(field)
    curve = scaled_curve(field.curve, share)
    places = grid.cells[rng.choice(len(grid.cells), min(samples, len(grid.cells)), replace=False)]
    places = places + rng.uniform(-0.5, 0.5, places.shape) * grid.cell_m
    counts = rng.poisson(share * field.rate_at(places) * dwell_s)
    field_map = FieldMap(grid, FieldMapSettings(curve=curve))
    field_map.set_samples(Samples(places, counts, np.full(len(places), dwell_s)))
    soil_map = field_map.update()
    assert soil_map is not None
    return misses(soil_map, possible_moisture(curve, share * field.rate_at(grid.cells)))


def misses(soil_map: SoilMap, truth: NDArray[np.float64]) -> Misses:
    """Compare a map with the true moisture of its cells inside."""
    inside = soil_map.grid.mask
    vwc, sd, low, high = (band[inside] for band in soil_map.bands[2:])
    mean = mean_moisture(soil_map)
    assert mean is not None
    return Misses(
        float(np.mean(truth < low)),
        float(np.mean(truth > high)),
        float(np.mean(truth < vwc - QUANTILE_SD * sd)),
        float(np.mean(truth > vwc + QUANTILE_SD * sd)),
        mean.value - float(truth.mean()),
        float(mean.p05 <= truth.mean() <= mean.p95),
    )


def coarse_grid(field: SurrogateField) -> FieldGrid:
    """A grid of about :data:`CELLS` cells."""
    return field.field.grid(max(field.field.grid(None).extent_m / CELLS**0.5, 1.0))


def scaled_curve(curve: MoistureCurve | None, share: float) -> CalibrationCurve:
    """The curve of a sensor with a share of the tubes."""
    known = curve if isinstance(curve, CalibrationCurve) else _CURVE
    return replace(known, n0_cps=share * known.n0_cps)


def rows(names: list[str], seeds: int, samples: int) -> Iterator[tuple[str, float, float, Misses]]:
    """Mean misses of each field, share and dwell."""
    for name in names:
        for share in SHARES:
            for dwell_s in DWELLS_S:
                found = []
                for seed in range(seeds):
                    rng = np.random.default_rng([seed, 7])
                    found.append(survey(surrogate_field(name, rng), samples, dwell_s, share, rng))
                yield name, share, dwell_s, Misses(*np.mean(found, axis=0).tolist())


def main() -> None:
    options = results.parser(__doc__)
    options.add_argument("--fields", nargs="+", default=list(FIELDS))
    options.add_argument("--seeds", type=int, default=20)
    options.add_argument("--samples", type=int, default=40)
    given = options.parse_args()
    table = [
        (
            name, f"{share:g}", f"{dwell_s:g}", *(f"{100 * value:.1f} %" for value in one[:4]),
            f"{100 * one.mean_error:+.2f}", f"{100 * one.mean_covered:.0f} %",
        )
        for name, share, dwell_s, one in rows(given.fields, given.seeds, given.samples)
    ]  # fmt: skip
    results.publish(
        "tails",
        (
            "field", "rate", "dwell [s]", "below p05", "above p95", "below -1.645 sd",
            "above +1.645 sd", "error of the mean [% vol.]", "interval of the mean covers",
        ),
        table,
        f"{given.samples} samples at random places, {given.seeds} seeds; rate: share of the field's rate",
        given.save,
    )  # fmt: skip


if __name__ == "__main__":
    main()
