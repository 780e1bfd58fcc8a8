# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration.planning.efficiency import CLOSE, least_variance
from soilmoist_ros.mapping import PoissonKriging, Variogram
from soilmoist_ros.mapping.variogram.model import Amplitude

X, Y = (axis.ravel() for axis in np.meshgrid(np.arange(2.0, 40.0, 4.0), np.arange(2.0, 30.0, 4.0)))
CELLS = np.column_stack([X, Y])
EVEN = np.full(len(CELLS), 1 / len(CELLS))
VARIOGRAM = Variogram("matern32", 0.0, 12.0, 1.0)


def integrated_variance(xy, exposure_s, rate_cps=4.0, weight=EVEN, variogram=VARIOGRAM):
    """What kriging leaves of the variance; the mean rate alone makes the noise."""
    kriging = PoissonKriging(variogram, False, mean_rate=rate_cps)
    kriging.fit(xy, np.rint(rate_cps * exposure_s), exposure_s)
    return float(weight @ kriging.predict(CELLS)[1])


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 40), weighted=st.booleans())
@pytest.mark.slow
def test_no_design_leaves_less(seed, count, weighted):
    rng = np.random.default_rng(seed)
    weight = rng.dirichlet(np.ones(len(CELLS))) if weighted else EVEN
    time_s = float(rng.uniform(100, 10_000))
    xy = CELLS[rng.choice(len(CELLS), count, replace=False)]
    exposure_s = np.maximum(time_s * rng.dirichlet(np.ones(count)), 1e-6)
    bound = least_variance(VARIOGRAM, CELLS, weight, np.full(len(CELLS), 4.0), time_s)
    # kriging does not know the mean at all, the bound knows a little: it is the lower one
    assert bound.integrated_variance * (1 - bound.gap) <= integrated_variance(xy, exposure_s, weight=weight)


def test_the_design_it_finds_leaves_what_it_says():
    bound = least_variance(VARIOGRAM, CELLS, EVEN, np.full(len(CELLS), 4.0), 3600.0)
    assert bound.gap <= 2 * CLOSE
    assert bound.dwell_s.sum() == pytest.approx(3600.0)
    used = bound.dwell_s > 1e-3
    left = integrated_variance(CELLS[used], bound.dwell_s[used])
    assert bound.integrated_variance == pytest.approx(left, rel=0.01)


def test_where_a_field_varies_more_the_bound_knows_it():
    """Without the amplitude, a plan that counts where the field varies left less than the bound."""
    smooth = (-0.9,) * 6
    rough = Amplitude((0.0, 0.0), (40.0, 30.0), (*[(0.9, 0.9, 0.9, -0.9, -0.9, -0.9)] * 3, smooth, smooth, smooth))
    uneven = replace(VARIOGRAM, amplitude=rough)
    bound = least_variance(uneven, CELLS, EVEN, np.full(len(CELLS), 4.0), 3600.0)
    amplitude = rough(CELLS)
    left = integrated_variance(CELLS, 3600.0 * amplitude / amplitude.sum(), variogram=uneven)
    assert 0.8 * left < bound.integrated_variance * (1 - bound.gap) <= left
    assert bound.dwell_s[amplitude > 1].mean() > bound.dwell_s[amplitude < 1].mean()


def test_more_time_and_fewer_noise_leave_less():
    rate = np.full(len(CELLS), 4.0)
    left = [least_variance(VARIOGRAM, CELLS, EVEN, rate, t).integrated_variance for t in (600.0, 3600.0, 36000.0)]
    assert left == sorted(left, reverse=True)
    quiet = least_variance(VARIOGRAM, CELLS, EVEN, rate / 10, 600.0).integrated_variance
    assert quiet < left[0]
    assert quiet == pytest.approx(
        least_variance(VARIOGRAM, CELLS, EVEN, rate, 6000.0).integrated_variance, rel=0.01
    )


def test_dry_soil_is_counted_longer_for_the_rate_and_weights_draw_the_time():
    rate = np.where(X < 20, 2.0, 6.0)
    dwell_s = least_variance(VARIOGRAM, CELLS, EVEN, rate, 7200.0).dwell_s
    assert dwell_s[X > 20].sum() > 1.2 * dwell_s[X < 20].sum()
    weight = np.where(X < 20, 9.0, 1.0) / (5 * len(CELLS))
    dwell_s = least_variance(VARIOGRAM, CELLS, weight, np.full(len(CELLS), 4.0), 7200.0).dwell_s
    assert dwell_s[X < 20].sum() > 1.5 * dwell_s[X > 20].sum()


@pytest.mark.parametrize(("time_s", "rate"), [(0.0, 4.0), (-1.0, 4.0), (float("nan"), 4.0), (60.0, 0.0)])
def test_no_time_and_no_rate_are_refused(time_s, rate):
    with pytest.raises(ValueError, match="must be > 0"):
        least_variance(VARIOGRAM, CELLS, EVEN, np.full(len(CELLS), rate), time_s)
