import contextlib
import dataclasses
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.mapping import (
    FieldGrid,
    PoissonKriging,
    Samples,
    Variogram,
    make_soil_map,
)
from soilmoist_ros.mapping.kriging import covariances, tile_covariances
from soilmoist_ros.mapping.kriging import rows as kriging_rows
from soilmoist_ros.mapping.kriging.raster import MapFollower
from soilmoist_ros.mapping.kriging.rows import BLOCK, MIN_TAIL
from soilmoist_ros.mapping.kriging.tile_covariances import TileCovariances
from soilmoist_ros.mapping.samples.spread import way_spread
from soilmoist_ros.mapping.variogram.model import MODELS

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
        self.columns = np.empty((0, 7))  # x, y, counts, exposure, spread

    @property
    def samples(self):
        columns = self.columns
        return Samples(columns[:, :2], columns[:, 2], columns[:, 3], columns[:, 4:])

    def append(self, count):
        rng = self.rng
        xy = rng.uniform((0, 0), (60, 45), (count, 2))
        xy[rng.random(count) < 0.2] = SMALL.cells[rng.integers(len(SMALL.cells))]  # where cells have their centre
        exposure_s = rng.uniform(50, 600, count)
        spread = way_spread(rng.uniform(-8, 8, (count, 2))) * (rng.random((count, 1)) < 0.5)
        spread += np.where(rng.random((count, 1)) < 0.2, [[9.0, 0.0, 9.0]], 0.0)
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
        row[4:] += way_spread([4.0, 2.0])

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


def follow(follower, mission):
    return follower.follow(mission.samples, mission.variogram, mission.mean_rate)


def kriged(mission, grid, keep_nugget):
    samples = mission.samples
    kriging = PoissonKriging(mission.variogram, keep_nugget, mission.mean_rate)
    kriging.fit(samples.xy, samples.counts, samples.exposure_s, samples.spread)
    return np.array(kriging.predict_grid(grid.x_m, grid.y_m, grid.mask))


def check_mission(grid, model, keep_nugget, first, actions, seed):
    follower, mission = MapFollower(grid, keep_nugget), Mission(model, seed)
    mission.append(first)
    for name, number in [("again", 0), *actions]:
        getattr(mission, name)(number)
        found = follow(follower, mission)
        assert found.tobytes() == follow(MapFollower(grid, keep_nugget), mission).tobytes()
        np.testing.assert_allclose(found, kriged(mission, grid, keep_nugget), rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("model", "keep_nugget"), [("matern32", True), ("exponential", False)])
@settings(max_examples=8, deadline=None)
@given(st.integers(1, 2 * BLOCK + MIN_TAIL), steps, st.integers(0, 99))
def test_maps_are_those_of_kriging_and_do_not_depend_on_those_before(model, keep_nugget, first, actions, seed):
    with mock.patch.object(covariances, "_AT_ONCE", 64), mock.patch.object(kriging_rows, "_AT_ONCE", 64):
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
        follower = MapFollower(grid, True)
        found = follow(follower, mission)
        if model not in ("gaussian", "spherical") and mission.variogram.anisotropy == 1:
            assert isinstance(follower._cells._covariances, TileCovariances)
        np.testing.assert_allclose(found, kriged(mission, grid, True), rtol=0, atol=2e-11)


@pytest.mark.parametrize("keep_nugget", [True, False])
@settings(max_examples=4, deadline=None)
@given(st.integers(1, 2 * BLOCK), steps, st.integers(0, 99))
def test_so_are_those_by_interpolation(keep_nugget, first, actions, seed):
    check_mission(FINE, "gaussian", keep_nugget, first, actions, seed)


def test_a_mission_in_single_steps_fills_blocks():
    follower, mission = MapFollower(FINE, True), Mission("matern32", 1)
    for _ in range(2 * BLOCK + MIN_TAIL + 1):
        mission.append(1)
        follow(follower, mission)
        mission.move(0)
        found = follow(follower, mission)
    assert len(follower._cells._blocks) == 2
    assert found.tobytes() == follow(MapFollower(FINE, True), mission).tobytes()


def test_gaussians_are_mapped_from_fewer_points_than_cells():
    follower, mission = MapFollower(FINE, True), Mission("gaussian", 1)
    mission.append(20)
    follow(follower, mission)
    assert follower._cells is None
    mission.variogram = dataclasses.replace(mission.variogram, range_m=3.0)
    follow(follower, mission)
    assert follower._cells is not None


def test_surfaces_that_are_not_resolved_take_more_points():
    follower, mission = MapFollower(FINE, False), Mission("gaussian", 1)
    mission.append(60)
    with mock.patch("soilmoist_ros.mapping.kriging.raster.first_degrees", return_value=(11, 9)):
        found = follow(follower, mission)
        assert len(follower._levels) > 1
        mission.forget(59)  # may need fewer: that must not depend on the maps before
        again, fresh = follow(follower, mission), follow(MapFollower(FINE, False), mission)
    assert again.tobytes() == fresh.tobytes()
    mission = Mission("gaussian", 1)
    mission.append(60)
    np.testing.assert_allclose(found, kriged(mission, FINE, False), rtol=0, atol=1e-9)


def test_samples_at_one_place_are_merged():
    follower, mission = MapFollower(SMALL, True), Mission("matern32", 3)
    mission.append(9)
    mission.columns[7, :2] = mission.columns[2, :2]
    np.testing.assert_allclose(follow(follower, mission), kriged(mission, SMALL, True), rtol=0, atol=1e-9)


def test_one_sample_is_enough():
    follower, mission = MapFollower(SMALL, True), Mission("spherical", 3)
    mission.append(1)
    np.testing.assert_allclose(follow(follower, mission), kriged(mission, SMALL, True), rtol=0, atol=1e-12)


def test_what_is_too_much_to_keep_is_kriged_at_once():
    follower, mission = MapFollower(SMALL, True), Mission("matern32", 3)
    mission.append(60)
    assert follow(follower, mission) is not None
    with mock.patch.object(kriging_rows, "MAX_ELEMENTS", 40 * len(SMALL.cells)):
        assert follow(follower, mission) is None
        soil_map = make_soil_map(mission.samples, SMALL, mission.variogram, follower=follower)
        assert isinstance(soil_map.made_by, PoissonKriging)
        mission.forget(30)
        found = follow(follower, mission)
    assert found.tobytes() == follow(MapFollower(SMALL, True), mission).tobytes()


def test_a_matrix_near_singular_is_left_to_kriging():
    follower, mission = MapFollower(SMALL, True), Mission("gaussian", 3)
    mission.variogram = Variogram("gaussian", 0.0, 50.0, 0.5)
    mission.append(50)
    good = follow(follower, mission)
    columns = mission.columns.copy()
    mission.columns[-5:, 2:4] *= 1e9
    mission.columns[-5:, :2] = mission.columns[0, :2] + 0.01 * np.arange(1, 6)[:, None]
    assert follow(follower, mission) is None
    mission.columns = columns
    assert follow(follower, mission).tobytes() == good.tobytes()


def test_near_the_least_pivot_rows_are_exact_enough():
    """Against kriging, whose Cholesky factor solves without an inverse."""
    mission = Mission("matern32", 5)
    mission.variogram = Variogram("matern32", 0.0, 60.0, 0.5)
    mission.append(80)
    mission.columns[:, 4:] = 0.0
    mission.columns[:, 3] *= 3000  # m*/t down to some 1e-6 of the sill
    mission.columns[:, 2] = mission.rng.poisson(MEAN_RATE * mission.columns[:, 3])
    mission.columns[1::2, :2] = mission.columns[::2, :2] + [0.05, 0.0]
    found = follow(MapFollower(SMALL, True), mission)
    np.testing.assert_allclose(found, kriged(mission, SMALL, True), rtol=0, atol=1e-9)


def test_memory_does_not_grow_while_the_robot_stands():
    follower, mission = MapFollower(SMALL, True), Mission("matern32", 3)
    mission.append(BLOCK + 20)
    follow(follower, mission)
    blocks = [id(block) for block in follower._cells._blocks]
    for _ in range(200):
        mission.move(0)
        follow(follower, mission)
    assert [id(block) for block in follower._cells._blocks] == blocks
