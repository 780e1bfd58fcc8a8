# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import contextlib
import dataclasses
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import FieldGrid, PoissonKriging, Samples, Variogram, make_soil_map
from soilmoist_ros.mapping.kriging import covariances, tile_covariances
from soilmoist_ros.mapping.kriging import raster as raster_module
from soilmoist_ros.mapping.kriging import rows as kriging_rows
from soilmoist_ros.mapping.kriging.raster import MIN_FEATURES, RasterKriging
from soilmoist_ros.mapping.kriging.rows import BLOCK, MIN_TAIL
from soilmoist_ros.mapping.kriging.tile_covariances import TileCovariances
from soilmoist_ros.mapping.samples import path_spread
from soilmoist_ros.mapping.variogram.model import BUILT_IN as MODELS

SMALL = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 40)], 4.0)
FINE = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 40)], 1.0)
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


@contextlib.contextmanager
def small_tiles():
    """Tiles where they are no gain."""
    with (
        mock.patch.object(tile_covariances, "CELLS", 150),
        mock.patch.object(tile_covariances, "WORTH_SHARE", 99.0),
    ):
        yield


def many_targets():
    """No number of targets counts as few."""
    return mock.patch.object(raster_module, "MAX_TARGETS", 0)


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
@pytest.mark.parametrize(("model", "keep_nugget"), [("matern32", True), ("exponential", False)])
@settings(max_examples=8, deadline=None)
@given(st.integers(1, 2 * BLOCK + MIN_TAIL), steps, st.integers(0, 99))
def test_maps_are_those_of_kriging_and_do_not_depend_on_those_before(
    few, model, keep_nugget, first, actions, seed
):
    with (
        mock.patch.object(raster_module, "MAX_SAMPLES", 2 * BLOCK) if few else many_targets(),
        mock.patch.object(covariances, "_AT_ONCE", 64),
        mock.patch.object(kriging_rows, "_AT_ONCE", 64),
    ):
        check_mission(SMALL, model, keep_nugget, first, actions, seed)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "keep_nugget"), [("matern32", True), ("exponential", False), ("spherical", True)]
)
@settings(max_examples=5, deadline=None)
@given(st.integers(1, 2 * BLOCK + MIN_TAIL), steps, st.integers(0, 99))
def test_so_are_those_of_tiles(model, keep_nugget, first, actions, seed):
    with small_tiles():
        check_mission(FINE, model, keep_nugget, first, actions, seed)


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
def test_maps_of_large_fields_are_those_of_kriging(model):
    rng = np.random.default_rng(7)
    ring = [(0, 0), (300, 40), (260, 200), (20, 180)]
    grid = FieldGrid.from_polygon(ring, 1.0)
    mission = Mission(model, 7)
    mission.append(90)
    mission.columns[:, :2] = rng.uniform((10, 10), (270, 180), (90, 2))
    mission.columns[:5, :2] = grid.cells[rng.integers(len(grid.cells), size=5)]
    for mission.variogram in variograms(model):
        raster = of_grid(grid, True)
        found = update(raster, mission)
        if model not in ("gaussian", "spherical") and mission.variogram.anisotropy == 1:
            assert isinstance(raster._cells._covariances, TileCovariances)
        np.testing.assert_allclose(found, kriged(mission, grid, True), rtol=0, atol=2e-11)


@pytest.mark.parametrize("keep_nugget", [True, False])
@settings(max_examples=4, deadline=None)
@given(st.integers(1, 2 * BLOCK), steps, st.integers(0, 99))
def test_so_are_those_by_interpolation(keep_nugget, first, actions, seed):
    check_mission(FINE, "gaussian", keep_nugget, first, actions, seed)


@pytest.mark.parametrize("anisotropy", [(1.0, 0.0), (2.0, 90.0), (2.0, 30.0)])
@pytest.mark.parametrize("count", [MIN_FEATURES - 1, MIN_FEATURES])
def test_gaussian_maps_are_those_of_points(anisotropy, count):
    mission = Mission("gaussian", 5)
    mission.append(count)
    mission.variogram, samples = Variogram("gaussian", 0.02, 35.0, 0.5, *anisotropy), mission.samples
    kriging = PoissonKriging(mission.variogram, True, MEAN_RATE)
    kriging.fit(samples.xy, samples.counts, samples.exposure_s, samples.spread)
    with mock.patch.object(RasterKriging, "_solved_by_tiles", side_effect=AssertionError("not interpolated")):
        found = np.array(kriging.predict_grid(FINE.x_m, FINE.y_m, FINE.mask))
    np.testing.assert_allclose(found, kriged(mission, FINE, True), rtol=0, atol=1e-8)


def test_a_mission_in_single_steps_fills_blocks():
    raster, mission = of_grid(FINE, True), Mission("matern32", 1)
    for _ in range(2 * BLOCK + MIN_TAIL + 1):
        mission.append(1)
        update(raster, mission)
        mission.move(0)
        found = update(raster, mission)
    assert len(raster._cells._blocks) == 2
    assert found.tobytes() == update(of_grid(FINE, True), mission).tobytes()


def test_gaussians_are_mapped_from_fewer_points_than_cells():
    raster, mission = of_grid(FINE, True), Mission("gaussian", 1)
    mission.append(20)
    update(raster, mission)
    assert raster._cells is None
    mission.variogram = dataclasses.replace(mission.variogram, range_m=3.0)
    update(raster, mission)
    assert raster._cells is not None


def test_surfaces_that_are_not_resolved_take_more_points():
    raster, mission = of_grid(FINE, False), Mission("gaussian", 1)
    mission.append(60)
    with mock.patch("soilmoist_ros.mapping.kriging.chebyshev.first_degrees", return_value=(11, 9)):
        found = update(raster, mission)
        assert len(raster._rows) > 1
        mission.forget(59)  # may need fewer: that must not depend on the maps before
        again, fresh = update(raster, mission), update(of_grid(FINE, False), mission)
    assert again.tobytes() == fresh.tobytes()
    mission = Mission("gaussian", 1)
    mission.append(60)
    np.testing.assert_allclose(found, kriged(mission, FINE, False), rtol=0, atol=1e-9)


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
    with mock.patch.object(kriging_rows, "MAX_ELEMENTS", 40 * len(SMALL.cells)):
        assert update(raster, mission) is None
        soil_map = make_soil_map(mission.samples, SMALL, mission.variogram, raster=raster)
        assert isinstance(soil_map.made_by, PoissonKriging)
        mission.forget(30)
        found = update(raster, mission)
    assert found.tobytes() == update(of_grid(SMALL, True), mission).tobytes()


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


@pytest.mark.parametrize("context", [contextlib.nullcontext, many_targets])
def test_near_the_least_pivot_rows_are_exact_enough(context):
    """Against kriging, whose Cholesky factor solves without an inverse."""
    mission = Mission("matern32", 5)
    mission.variogram = Variogram("matern32", 0.0, 60.0, 0.5)
    mission.append(80)
    mission.columns[:, 4:] = 0.0
    mission.columns[:, 3] *= 3000  # m*/t down to some 1e-6 of the sill
    mission.columns[:, 2] = mission.rng.poisson(MEAN_RATE * mission.columns[:, 3])
    mission.columns[1::2, :2] = mission.columns[::2, :2] + [0.05, 0.0]
    with context():
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


X_M, Y_M = 3.0 * np.arange(260), 2.0 * np.arange(200)


def survey(variogram, exposure_s=200.0, keep_nugget=True):
    rng = np.random.default_rng(4)
    xy = rng.uniform(-20, 800, (256, 2)) * [1.0, 0.5]
    xy[0] = X_M[30], Y_M[100]  # exactly a cell's centre
    spread = np.zeros((len(xy), 3))
    spread[::9] = 40.0, 10.0, 20.0
    counts = rng.poisson(4.0 * exposure_s, len(xy))
    return PoissonKriging(variogram, keep_nugget=keep_nugget).fit(xy, counts, np.full(len(xy), exposure_s), spread)


def by_points(kriging, x_m, y_m, mask):
    """Some of the cells, among them the first one with a sample, and what they are as points."""
    row, column = np.nonzero(mask)
    some = np.append(np.arange(0, len(row), 37), np.flatnonzero((x_m[column] == X_M[30]) & (y_m[row] == Y_M[100])))
    row, column = row[some], column[some]
    return (row, column), kriging.predict(np.column_stack([x_m[column], y_m[row]]))


@pytest.mark.slow
@pytest.mark.parametrize("keep_nugget", [True, False])
@pytest.mark.parametrize(
    "variogram",
    [
        Variogram("matern32", 0.02, 60.0, 0.5),
        Variogram("exponential", 0.0, 200.0, 0.5, 2.0, 33.0),
        Variogram("matern52", 0.02, 15.0, 0.5),
    ],
)
def test_large_rasters_of_many_samples_by_tiles_are_those_of_points(variogram, keep_nugget):
    mask = np.random.default_rng(1).random((len(Y_M), len(X_M))) < 0.95
    mask[100, 30] = True
    mask[:60, :50] = False
    kriging, shares = survey(variogram, keep_nugget=keep_nugget), []
    with mock.patch.object(raster_module, "RasterCells", side_effect=AssertionError("not by tiles")):
        rasters = kriging.predict_grid(X_M, Y_M, mask, shares.append)
    cells, expected = by_points(kriging, X_M, Y_M, mask)
    for raster, values, scale in zip(rasters, expected, (np.sqrt(0.5), 0.5), strict=True):
        assert np.isnan(raster[~mask]).all()
        np.testing.assert_allclose(raster[cells], values, rtol=0, atol=1e-8 * scale)
    assert len(shares) > 1
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("variogram", "exposure_s", "y_m"),
    [
        (Variogram("spherical", 0.02, 60.0, 0.5), 200.0, Y_M),
        (Variogram("matern52", 0.0, 900.0, 0.5), 1e9, Y_M),  # too near to singular for an inverse
        (Variogram("matern32", 0.02, 60.0, 0.5), 200.0, Y_M**1.1),
    ],
)
def test_others_are_kriged_cell_by_cell(variogram, exposure_s, y_m):
    kriging, mask = survey(variogram, exposure_s), np.ones((len(Y_M), len(X_M)), bool)
    with mock.patch.object(raster_module, "tile_sums", side_effect=AssertionError("by tiles")):
        rate, variance = kriging.predict_grid(X_M, y_m, mask)
    cells, expected = by_points(kriging, X_M, y_m, mask)
    np.testing.assert_allclose(rate[cells], expected[0], rtol=1e-9)
    np.testing.assert_allclose(variance[cells], expected[1], rtol=0, atol=1e-9)
