# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kriging of one raster again and again: maps are those of kriging, and depend on nothing kept, bit for bit."""

from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import FieldGrid, PoissonKriging, Samples, Variogram, make_soil_map
from soilmoist_ros.mapping.kriging import rows as kriging_rows
from soilmoist_ros.mapping.kriging.rows import RasterKriging
from soilmoist_ros.mapping.samples import path_spread

SMALL = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 40)], 4.0)
MEAN_RATE = 3.0


def variograms(model):
    return [
        Variogram(model, 0.02, 30.0, 0.5),
        Variogram(model, 0.0, 25.0, 0.4, 2.0, 30.0),
        Variogram(model, 0.05, 60.0, 0.3, 3.0, 90.0),
    ]


class Mission:
    """Samples that grow as those of a mission do."""

    def __init__(self, model, seed):
        self.rng = np.random.default_rng(seed)
        self.choices = variograms(model)
        self.variogram = self.choices[0]
        self.mean_rate = MEAN_RATE
        self.columns = np.empty((0, 8))  # x, y, counts, exposure, spread

    @property
    def samples(self):
        columns = self.columns
        return Samples(columns[:, :2], columns[:, 2], columns[:, 3], columns[:, 4:])

    def append(self, count):
        rng = self.rng
        xy = rng.uniform((0, 0), (60, 45), (count, 2))
        xy[rng.random(count) < 0.2] = SMALL.cells[rng.integers(len(SMALL.cells))]  # where cells have their centre
        exposure_s = rng.uniform(50, 600, count)
        spread = path_spread(rng.uniform(-8, 8, (count, 2))) * (rng.random((count, 1)) < 0.5)
        spread += np.where(rng.random((count, 1)) < 0.2, [[9.0, 0.0, 9.0, 8.0]], 0.0)
        counts = rng.poisson(MEAN_RATE * exposure_s)
        self.columns = np.concatenate([self.columns, np.column_stack([xy, counts, exposure_s, spread])])

    def grow(self, back):
        """A record joins the sample so far from the last."""
        row = self.columns[-1 - back % len(self.columns)]
        row[2:4] += self.rng.poisson(MEAN_RATE * 10), 10.0

    def move(self, back):
        self.grow(back)
        self.columns[-1 - back % len(self.columns), :2] += self.rng.normal(0, 0.1, 2)

    def widen(self, back):
        row = self.columns[-1 - back % len(self.columns)]
        row[4:] += path_spread([4.0, 2.0])

    def refit(self, number):
        self.variogram, self.mean_rate = self.choices[number % 3], MEAN_RATE + 0.1 * number

    def forget(self, count):
        self.columns = self.columns[: max(1, len(self.columns) - count)].copy()

    def again(self, _):
        """Nothing new."""


ACTIONS = ("append", "append", "grow", "move", "widen", "refit", "forget", "again")
steps = st.lists(st.tuples(st.sampled_from(ACTIONS), st.integers(0, 64)), min_size=1, max_size=6)


def of_grid(grid, keep_nugget):
    return RasterKriging(grid.x_m, grid.y_m, grid.mask, keep_nugget)


def update(raster, mission):
    return raster.update(mission.samples, mission.variogram, mission.mean_rate)


def kriged(mission, grid, keep_nugget):
    samples = mission.samples
    kriging = PoissonKriging(mission.variogram, keep_nugget, mission.mean_rate)
    kriging.fit(samples.xy, samples.counts, samples.exposure_s, samples.spread)
    return np.array([grid.to_raster(values) for values in kriging.predict(grid.cells)])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "keep_nugget"), [("matern32", True), ("exponential", False), ("gaussian", True)]
)
@settings(max_examples=8, deadline=None)
@given(st.integers(1, 72), steps, st.integers(0, 99))
def test_maps_are_those_of_kriging_and_do_not_depend_on_those_before(model, keep_nugget, first, actions, seed):
    raster, mission = of_grid(SMALL, keep_nugget), Mission(model, seed)
    mission.append(first)
    for name, number in [("again", 0), *actions]:
        getattr(mission, name)(number)
        found = update(raster, mission)
        assert found.tobytes() == update(of_grid(SMALL, keep_nugget), mission).tobytes()
        np.testing.assert_allclose(found, kriged(mission, SMALL, keep_nugget), rtol=0, atol=1e-9)


def test_what_is_too_much_to_keep_is_kriged_at_once():
    raster, mission = of_grid(SMALL, True), Mission("matern32", 3)
    mission.append(60)
    with mock.patch.object(kriging_rows, "MAX_SAMPLES", 40):
        assert update(raster, mission) is None
        soil_map = make_soil_map(mission.samples, SMALL, mission.variogram, raster=raster)
        assert isinstance(soil_map.made_by, PoissonKriging)
    with mock.patch.object(kriging_rows, "MAX_TARGETS", 20):
        assert update(raster, mission) is None
    assert update(raster, mission).tobytes() == update(of_grid(SMALL, True), mission).tobytes()


def test_a_matrix_near_singular_is_left_to_kriging():
    raster, mission = of_grid(SMALL, True), Mission("gaussian", 3)
    mission.variogram = Variogram("gaussian", 0.0, 50.0, 0.5)
    mission.append(50)
    good = update(raster, mission)
    columns = mission.columns.copy()
    mission.columns[-5:, 2:4] *= 1e9
    mission.columns[-5:, :2] = mission.columns[0, :2] + 0.01 * np.arange(1, 6)[:, None]
    assert update(raster, mission) is None
    mission.columns = columns
    assert update(raster, mission).tobytes() == good.tobytes()
