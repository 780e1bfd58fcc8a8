# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Kriging on line: maps are those of kriging, and depend on nothing that was kept, bit for bit."""

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import FieldGrid, PoissonKriging, Samples, Variogram, make_soil_map
from soilmoist_ros.mapping.kriging import rows as kriging_rows
from soilmoist_ros.mapping.kriging.rows import BLOCK, MIN_TAIL, FewTargets, KrigingRows, RasterKriging
from soilmoist_ros.mapping.samples import path_spread
from soilmoist_ros.mapping.variogram.model import Amplitude

SMALL = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 40)], 4.0)
FINE = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 40)], 1.0)
MEAN_RATE = 3.0
RNG = np.random.default_rng(8)
TARGETS = RNG.uniform(0, 60, (40, 2))
SAMPLES = Samples(
    RNG.uniform(0, 60, (90, 2)), RNG.poisson(400, 90), np.full(90, 100.0), path_spread(RNG.uniform(-6, 6, (90, 2)))
)
STATIONARY = Variogram("matern32", 0.02, 20.0, 0.4, 2.0, 30.0)
UNEVEN = replace(
    STATIONARY, amplitude=Amplitude((0.0, 0.0), (60.0, 60.0), np.linspace(-0.5, 0.7, 16).reshape(4, 4))
)


def first(count):
    return Samples(SAMPLES.xy[:count], SAMPLES.counts[:count], SAMPLES.exposure_s[:count], SAMPLES.spread[:count])


@pytest.mark.parametrize("kind", [FewTargets, KrigingRows])
@pytest.mark.parametrize("variogram", [STATIONARY, UNEVEN])
def test_surfaces_are_those_of_kriging_however_many_samples_came_at_once(variogram, kind):
    targets = np.vstack([TARGETS, SAMPLES.xy[:1]])
    grown = kind(targets, True)
    for count in (1, 20, 70, 90, 65):
        samples = first(count)
        found = grown.update(samples, variogram, 4.0)
        kriging = PoissonKriging(variogram, True, 4.0)
        kriging.fit(samples.xy, samples.counts, samples.exposure_s, samples.spread)
        rate, variance = kriging.predict(targets)
        amplitude = variogram.amplitude_at(targets)
        prior = variogram.sill * (1.0 if amplitude is None else amplitude**2)
        np.testing.assert_allclose(found, [rate, variance - prior], atol=1e-10)
        assert found.tobytes() == kind(targets, True).update(samples, variogram, 4.0).tobytes()


def test_the_kriging_of_a_map_takes_the_covariance_over():
    grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 60), (0, 60)], 4.0)
    raster = RasterKriging(grid.x_m, grid.y_m, grid.mask, True)
    make_soil_map(first(60), grid, STATIONARY, raster=raster)
    kept = make_soil_map(SAMPLES, grid, STATIONARY, raster=raster)
    fresh = make_soil_map(SAMPLES, grid, STATIONARY)
    assert kept.known is not None
    assert fresh.known is None
    for one, other in zip(kept.kriging.predict(TARGETS), fresh.kriging.predict(TARGETS), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10)
    places = np.vstack([grid.cells, TARGETS])
    found = kept.kriging.rate_and_covariance(places, kept.known.with_targets)
    for one, other in zip(found, fresh.kriging.rate_and_covariance(places), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_all_covariances_that_are_taken_over_are_numbers(monkeypatch):
    """Above the diagonal nothing is computed; what a freed array left there may overflow in sums."""
    empty = np.empty
    monkeypatch.setattr(np, "empty", lambda *shape: np.full_like(empty(*shape), np.nan))
    few = FewTargets(TARGETS, True)
    monkeypatch.undo()
    for count in (20, 40):
        few.update(first(count), STATIONARY, 4.0)
        assert np.isfinite(few.known.of_samples).all()


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
        """The same, not quite at its place."""
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
steps = st.lists(st.tuples(st.sampled_from(ACTIONS), st.integers(0, 2 * BLOCK)), min_size=1, max_size=6)


def many_targets():
    """No number of targets counts as few."""
    return mock.patch.object(kriging_rows, "MAX_TARGETS", 0)


def of_grid(grid, keep_nugget):
    return RasterKriging(grid.x_m, grid.y_m, grid.mask, keep_nugget)


def update(raster, mission):
    return raster.update(mission.samples, mission.variogram, mission.mean_rate)


def kriged(mission, grid, keep_nugget):
    samples = mission.samples
    kriging = PoissonKriging(mission.variogram, keep_nugget, mission.mean_rate)
    kriging.fit(samples.xy, samples.counts, samples.exposure_s, samples.spread)
    return np.array([grid.to_raster(values) for values in kriging.predict(grid.cells)])


def check_mission(grid, model, keep_nugget, first, actions, seed):
    raster, mission = of_grid(grid, keep_nugget), Mission(model, seed)
    mission.append(first)
    for name, number in [("again", 0), *actions]:
        getattr(mission, name)(number)
        found = update(raster, mission)
        assert found.tobytes() == update(of_grid(grid, keep_nugget), mission).tobytes()
        np.testing.assert_allclose(found, kriged(mission, grid, keep_nugget), rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("few", [False, True])
@pytest.mark.parametrize(
    ("model", "keep_nugget"), [("matern32", True), ("exponential", False), ("gaussian", True)]
)
@settings(max_examples=8, deadline=None)
@given(st.integers(1, 2 * BLOCK + MIN_TAIL), steps, st.integers(0, 99))
def test_maps_are_those_of_kriging_and_do_not_depend_on_those_before(
    few, model, keep_nugget, first, actions, seed
):
    with mock.patch.object(kriging_rows, "MAX_SAMPLES", 2 * BLOCK) if few else many_targets():
        check_mission(SMALL, model, keep_nugget, first, actions, seed)


def test_a_mission_in_single_steps_fills_blocks():
    raster, mission = of_grid(FINE, True), Mission("matern32", 1)
    for _ in range(2 * BLOCK + MIN_TAIL + 1):
        mission.append(1)
        update(raster, mission)
        mission.move(0)
        found = update(raster, mission)
    assert len(raster._cells._blocks) == 2
    assert found.tobytes() == update(of_grid(FINE, True), mission).tobytes()


def test_samples_at_one_place_are_merged():
    raster, mission = of_grid(SMALL, True), Mission("matern32", 3)
    mission.append(9)
    mission.columns[7, :2] = mission.columns[2, :2]
    np.testing.assert_allclose(update(raster, mission), kriged(mission, SMALL, True), rtol=0, atol=1e-9)


def test_one_sample_is_enough():
    raster, mission = of_grid(SMALL, True), Mission("spherical", 3)
    mission.append(1)
    np.testing.assert_allclose(update(raster, mission), kriged(mission, SMALL, True), rtol=0, atol=1e-12)


@many_targets()
def test_what_is_too_much_to_keep_is_kriged_at_once():
    raster, mission = of_grid(SMALL, True), Mission("matern32", 3)
    mission.append(60)
    assert update(raster, mission) is not None
    with mock.patch.object(kriging_rows, "MAX_ROWS", 40):
        assert update(raster, mission) is None
        soil_map = make_soil_map(mission.samples, SMALL, mission.variogram, raster=raster)
        assert isinstance(soil_map.made_by, PoissonKriging)
    mission.forget(30)
    found = update(raster, mission)
    assert found.tobytes() == update(of_grid(SMALL, True), mission).tobytes()
    with mock.patch.object(kriging_rows, "MAX_ELEMENTS", 20 * len(SMALL.cells)):
        assert update(raster, mission) is None


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


@pytest.mark.parametrize("few", [True, False])
def test_near_the_least_pivot_rows_are_exact_enough(few):
    """Against kriging, whose Cholesky factor solves without an inverse."""
    mission = Mission("matern32", 5)
    mission.variogram = Variogram("matern32", 0.0, 60.0, 0.5)
    mission.append(80)
    mission.columns[:, 4:] = 0.0
    mission.columns[:, 3] *= 3000  # m*/t down to some 1e-6 of the sill
    mission.columns[:, 2] = mission.rng.poisson(MEAN_RATE * mission.columns[:, 3])
    mission.columns[1::2, :2] = mission.columns[::2, :2] + [0.05, 0.0]
    with mock.patch.object(kriging_rows, "MAX_TARGETS", 1000 if few else 0):
        found = update(of_grid(SMALL, True), mission)
    np.testing.assert_allclose(found, kriged(mission, SMALL, True), rtol=0, atol=1e-9)


@many_targets()
def test_memory_does_not_grow_while_the_robot_stands():
    raster, mission = of_grid(SMALL, True), Mission("matern32", 3)
    mission.append(BLOCK + 20)
    update(raster, mission)
    blocks = [id(block) for block in raster._cells._blocks]
    for _ in range(200):
        mission.move(0)
        update(raster, mission)
    assert [id(block) for block in raster._cells._blocks] == blocks
