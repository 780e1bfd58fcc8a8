# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration.planning.planning_model import PlanningModel, spread_cells
from soilmoist_ros.mapping import PoissonKriging, Variogram

X, Y = (axis.ravel() for axis in np.meshgrid(np.arange(2.0, 60.0, 4.0), np.arange(2.0, 50.0, 4.0)))
CELLS = np.column_stack([X, Y])
EVEN = np.full(len(CELLS), 1 / len(CELLS))


def kriging(seed=0, nugget=0.02, count=12):
    rng = np.random.default_rng(seed)
    xy, exposure_s = rng.uniform(0, 55, (count, 2)), rng.uniform(20, 300, count)
    counts = rng.poisson(exposure_s * (3 + xy[:, 0] / 30))
    return PoissonKriging(Variogram("matern32", nugget, 15.0, 1.2), keep_nugget=False).fit(xy, counts, exposure_s)


def after_counting(before, xy, noise_s):
    places, m = before.places, before.noise_mean_rate
    after = PoissonKriging(before.variogram, False, mean_rate=m)
    return after.fit(
        np.vstack([places.xy, xy]),
        np.concatenate([places.counts, np.rint(m * noise_s)]),
        np.concatenate([places.exposure_s, noise_s]),
    )


@settings(deadline=None, max_examples=30)
@given(
    seed=st.integers(0, 1000),
    factor=st.floats(0.5, 2),
    exposures=st.lists(st.floats(5, 900), min_size=1, max_size=4),
    weighted=st.booleans(),
)
def test_the_fall_is_that_of_kriging_with_such_counts(seed, factor, exposures, weighted):
    rng = np.random.default_rng([seed, 1])
    weight = rng.uniform(0, 2, len(CELLS)) / len(CELLS) if weighted else EVEN
    before = kriging(seed)
    stops = rng.uniform(0, 55, (len(exposures), 2))
    model = PlanningModel(before, CELLS, weight, stops, factor)
    at, exposure_s = model.stop_nodes, np.array(exposures)
    noise_s = before.noise_mean_rate / (factor * model.rate[at] / exposure_s)
    after = after_counting(before, stops, noise_s)
    expected = weight @ (before.predict(CELLS)[1] - after.predict(CELLS)[1])
    assert model.fall(at, exposure_s) == pytest.approx(expected, rel=1e-8, abs=1e-12)
    assert model.integrated_variance == pytest.approx(weight @ before.predict(CELLS)[1], rel=1e-9)


def test_stops_that_are_cells_share_their_nodes():
    model = PlanningModel(kriging(), CELLS, EVEN, np.vstack([[3.0, 3.0], CELLS[7], [1.0, 1.0]]))
    assert model.stop_nodes.tolist() == [len(CELLS), 7, len(CELLS) + 1]
    assert len(model.rate) == len(CELLS) + 2
    assert model.nearest_nodes([[[6.1, 6.2]], [[3.1, 3.2]]]).tolist() == [[16], [len(CELLS)]]


@settings(deadline=None)
@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 500))
def test_few_cells_are_spread_evenly(rows, columns, most):
    mask = np.ones((rows, columns), bool)
    chosen = spread_cells(mask, most)
    assert max(min(most, mask.sum()) / 2 - 1, 1) <= chosen.sum() <= 3 * most + 1
    if mask.sum() <= most:
        assert chosen.all()


def test_cells_of_a_field_too_narrow_for_the_spacing_lie_along_it():
    mask = np.zeros((100, 100), bool)
    mask[0] = True
    assert np.flatnonzero(spread_cells(mask, 5)).tolist() == [10, 30, 50, 70, 90]
    assert (spread_cells(mask[:1].T, 5) == spread_cells(mask[:1], 5).T).all()
