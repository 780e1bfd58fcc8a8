# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Share of true moistures below ``vwc_p05`` and above ``vwc_p95``: 5 % each would be exact."""

from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.mapping import FieldMap, FieldMapSettings, Samples
from soilmoist_ros.mapping.moisture_bands import QUANTILE_SD, possible_moisture
from soilmoist_ros.simulation.fields.catalogue import surrogate_field

SEEDS, SAMPLES, CELLS = 12, 40, 800


def misses(seed, share, dwell_s):
    """Misses of a survey at random places of a field: below, above, and both for ``vwc`` +- 1.645 ``vwc_sd``.

    The rates are a share of the field's: a tenth is a sensor of one tube.
    """
    rng = np.random.default_rng([seed, 7])
    field = surrogate_field("rough", rng)
    grid = field.field.grid(max(field.field.grid(None).extent_m / CELLS**0.5, 1.0))
    curve = replace(field.curve, n0_cps=share * field.curve.n0_cps)
    places = grid.cells[rng.choice(len(grid.cells), SAMPLES, replace=False)]
    places = places + rng.uniform(-0.5, 0.5, places.shape) * grid.cell_m
    counts = rng.poisson(share * field.rate_at(places) * dwell_s)
    field_map = FieldMap(grid, FieldMapSettings(curve=curve))
    field_map.set_samples(Samples(places, counts, np.full(len(places), dwell_s)))
    soil_map = field_map.update()
    truth = possible_moisture(curve, share * field.rate_at(grid.cells))
    vwc, sd, low, high = (band[soil_map.grid.mask] for band in soil_map.bands[2:])
    symmetric = QUANTILE_SD * sd
    return [
        np.mean(missed) for missed in (truth < low, truth > high, truth < vwc - symmetric, truth > vwc + symmetric)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("share", "dwell_s"), [(1.0, 60.0), (0.1, 10.0)])
def test_the_quantiles_miss_equally_often_on_both_sides(share, dwell_s):
    below, above, symmetric_below, symmetric_above = np.mean(
        [misses(seed, share, dwell_s) for seed in range(SEEDS)], axis=0
    )
    assert 0.015 < below < 0.085
    assert 0.015 < above < 0.085
    assert symmetric_below < 0.015 < 0.04 < symmetric_above, "nearly all its misses are above"
