# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from pydantic import ValidationError

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.variogram.correlation import BUILT_IN as MODELS
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.simulation.fields.catalogue import AIRFIELD_SOIL, surrogate_field, surrogate_field_names
from soilmoist_ros.simulation.fields.formulas import FAMILIES, formula, random_field
from soilmoist_ros.simulation.fields.rate_grid import Extent, RateGrid, filled, krige, kriged_grid

SQUARE = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 30.0], [0.0, 30.0]])
EXTENT = Extent.of(SQUARE, 2.0)
PARAMETERS = {
    "gaussian_field": {"mean": 4.0, "sd": 0.8},
    "exponential": {"mean": 4.0, "sd": 0.8},
    "matern32": {"mean": 4.0, "sd": 0.8},
    "patches": {"background": 4.0, "patch": 3.0},
    "ridge": {"background": 3.0, "crest": 4.0},
    "gradient": {"low": 3.0, "high": 4.0},
    "half": {"low": 3.0, "high": 4.0},
    "halves": {"mean": 4.0, "sd": 0.8},
    "rough_patch": {"mean": 4.0, "sd": 0.8},
    "strips": {"mean": 4.0, "sd": 0.8},
    "texture": {"low": 3.0, "high": 4.0},
}
UNEVEN = ["halves", "rough_patch", "strips"]


def cells_of(surrogate):
    return FieldGrid.from_polygon(surrogate.polygon, surrogate.field.cell_m).cells


# Built-in fields


def test_the_built_in_fields_are_those_published():
    assert surrogate_field_names()[:4] == ["synthetic-high", "synthetic-low", "airfield-simulated", "validation"]


@pytest.mark.parametrize(
    ("name", "size", "points", "hours"),
    [
        ("synthetic-high", (60, 50), 78, 2),
        ("synthetic-low", (60, 50), 78, 2),
        ("airfield-simulated", (60, 50), 78, 2),
        ("validation", (210, 330), 72, 4),
    ],
)
def test_size_points_and_mission_time(name, size, points, hours):
    surrogate = surrogate_field(name)
    np.testing.assert_array_equal(np.ptp(surrogate.polygon, axis=0), size)
    assert surrogate.points_xy.shape == (points, 2)
    assert surrogate.hours == hours
    assert surrogate.name == name


@pytest.mark.parametrize(
    ("name", "wet", "dry", "west_east"),
    [
        ("synthetic-high", 2.5, 5.0, [[3, 25], [57, 25]]),
        ("synthetic-low", 3.0, 4.0, [[3, 25], [57, 25]]),
        ("airfield-simulated", 3.015, 3.996, [[3, 25], [57, 25]]),
        ("validation", 2.878, 3.096, [[150, 270], [60, 90]]),
    ],
)
def test_the_contrast_is_right_at_both_ends(name, wet, dry, west_east):
    assert surrogate_field(name).rate_at(west_east) == pytest.approx([wet, dry], rel=0.04)


@pytest.mark.parametrize("name", ["synthetic-high", "synthetic-low", "validation"])
def test_point_rates_without_noise_are_reproduced(name):
    surrogate = surrogate_field(name)
    np.testing.assert_allclose(surrogate.rate_at(surrogate.points_xy), surrogate.points_rate, rtol=0.02)


def test_drawn_point_rates_are_met_to_within_their_noise():
    surrogate = surrogate_field("airfield-simulated")
    noise = np.sqrt(surrogate.points_rate / 600)
    assert (np.abs(surrogate.rate_at(surrogate.points_xy) - surrogate.points_rate) < noise).all()


def test_the_line_of_the_simulated_airfield_is_repeated():
    lines = surrogate_field("airfield-simulated").points_rate.reshape(6, 13)
    np.testing.assert_array_equal(lines, np.tile(lines[0], (6, 1)))
    counts = lines[0] * 600
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-9)


@pytest.mark.parametrize("name", ["synthetic-high", "synthetic-low", "airfield-simulated", "validation"])
def test_rates_and_moistures_are_possible_everywhere(name):
    surrogate = surrogate_field(name)
    cells = cells_of(surrogate)
    rate, vwc = surrogate.rate_at(cells), surrogate.vwc_at(cells)
    given = surrogate.points_rate
    assert rate.min() > 0
    assert given.min() - 0.1 * np.ptp(given) < rate.min()
    assert rate.max() < given.max() + 0.1 * np.ptp(given)
    assert surrogate.curve.valid(rate).all()
    porosity = 1 - surrogate.curve.bulk_density_gcm3 / 2.65
    assert vwc.min() > 0
    assert vwc.max() < porosity
    np.testing.assert_allclose(surrogate.curve.rate_cps(vwc), rate)


@pytest.mark.parametrize("name", ["synthetic-high", "synthetic-low"])
def test_the_border_is_where_the_rate_changes(name):
    surrogate = surrogate_field(name)
    x = np.arange(0.5, 60)
    for y in (2.5, 25.5, 48.5):
        rate = surrogate.rate_at(np.column_stack([x, np.full_like(x, y)]))
        steepest = x[:-1][np.argmax(np.diff(rate))] + 0.5
        assert steepest == pytest.approx(30 + 0.2 * (y - 25), abs=2.5)
        low, high = surrogate.points_rate.min(), surrogate.points_rate.max()
        changes = x[(rate > low + 0.1 * (high - low)) & (rate < high - 0.1 * (high - low))]
        assert 5 < np.ptp(changes) < 20


def test_the_rates_of_the_low_contrast_are_those_of_5_and_20_percent():
    np.testing.assert_allclose(AIRFIELD_SOIL.rate_cps([0.20, 0.05]), [3.0, 4.0], atol=0.02)


def test_the_moisture_of_the_validation_field():
    vwc = surrogate_field("validation").vwc_at(cells_of(surrogate_field("validation")))
    assert np.percentile(vwc, [5, 95]) == pytest.approx([0.18, 0.24], abs=0.005)


def test_a_field_is_made_once_and_always_the_same():
    first = surrogate_field("airfield-simulated")
    assert surrogate_field("airfield-simulated") is first
    assert first.points_rate[:4] == pytest.approx([3.01, 3.02, 3.05, 3.2], abs=0.25)


def test_a_generator_draws_another_field():
    rates = [surrogate_field("airfield-simulated", np.random.default_rng(seed)).points_rate for seed in (1, 1, 2)]
    np.testing.assert_array_equal(rates[0], rates[1])
    assert (rates[0] != rates[2]).any()
    assert (rates[0] != surrogate_field("airfield-simulated").points_rate).any()


def test_the_cells_of_the_map_are_nodes_of_the_truth():
    surrogate = surrogate_field("synthetic-high")
    grid = surrogate.truth.grid
    for place, value in zip(cells_of(surrogate)[::97], surrogate.rate_at(cells_of(surrogate)[::97]), strict=True):
        column, row = np.searchsorted(grid.x_m, place[0]), np.searchsorted(grid.y_m, place[1])
        assert grid.values[row, column] == pytest.approx(value, rel=1e-12)


def test_one_place_may_be_given_as_a_pair():
    surrogate = surrogate_field("synthetic-low")
    assert surrogate.rate_at([10.0, 20.0]) == pytest.approx(surrogate.rate_at([[10.0, 20.0]]))


def test_far_outside_the_rate_stays_that_of_the_edge():
    surrogate = surrogate_field("synthetic-low")
    assert surrogate.rate_at([[-500.0, 25.0]]) == pytest.approx(surrogate.rate_at([[-10.0, 25.0]]))


def test_an_unknown_name_lists_those_there_are():
    with pytest.raises(
        InputError, match=r"'sythetic-high' -> give one of: synthetic-high, .*did you mean 'synthetic-h"
    ):
        surrogate_field("sythetic-high")


# Extrapolation


def test_kriging_agrees_with_the_equations_solved_directly():
    rng = np.random.default_rng(4)
    xy, values = rng.uniform(0, 40, (9, 2)), rng.uniform(3, 5, 9)
    variogram = Variogram("matern32", 0.0, 12.0, 0.7)
    place = np.array([[11.0, 17.0]])
    distance = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    system = np.block([[variogram.covariance(distance), np.ones((9, 1))], [np.ones((1, 9)), np.zeros((1, 1))]])
    right = np.append(variogram.covariance(np.hypot(*(xy - place).T)), 1.0)
    expected = np.linalg.solve(system, right)[:9] @ values
    assert krige(xy, values, variogram, place[:, 0], place[:, 1])[0, 0] == pytest.approx(expected, rel=1e-9)


def test_a_nugget_is_filtered_without_spikes():
    rng = np.random.default_rng(5)
    xy, values = rng.uniform(0, 40, (30, 2)), rng.normal(4, 0.1, 30)
    variogram = Variogram("exponential", 0.01, 20.0, 0.02)
    at, near = (krige(xy, values, variogram, xy[:1, 0] + shift, xy[:1, 1])[0, 0] for shift in (0.0, 1e-6))
    assert at == pytest.approx(near, abs=1e-5)
    assert abs(at - values[0]) > 1e-3


def test_an_ill_conditioned_system_is_refused():
    xy = np.column_stack([np.linspace(0, 10, 60), np.zeros(60)])
    with pytest.raises(ValueError, match="ill-conditioned for the gaussian model with range 50 m"):
        krige(xy, np.sin(xy[:, 0]) + 4, Variogram("gaussian", 0.0, 50.0, 1.0), np.arange(3.0), np.arange(3.0))


def test_an_extrapolation_below_zero_is_refused():
    xy = np.array([[0.0, 10.0], [8.0, 10.0], [10.0, 10.0], [30.0, 10.0]])
    with pytest.raises(ValueError, match=r"the extrapolated rate is -.* counts/s at x = .*overshoots"):
        kriged_grid(xy, np.array([9.0, 1.0, 0.01, 9.0]), Variogram("matern52", 0.0, 30.0, 10.0), EXTENT)


# Grid


def test_interpolation_is_bilinear_and_constant_beyond_the_edge():
    grid = RateGrid(np.array([0.0, 2.0]), np.array([0.0, 4.0]), np.array([[1.0, 3.0], [5.0, 7.0]]))
    places = np.array([[0, 0], [1, 0], [1, 2], [2, 4], [-9, 0], [9, 9]], float)
    np.testing.assert_allclose(grid(places), [1, 2, 4, 7, 1, 7])


def test_gaps_take_the_nearest_value():
    nan = np.nan
    np.testing.assert_array_equal(filled(np.array([[1.0, nan, nan, 4.0]])), [[1, 1, 4, 4]])


def test_a_grid_of_a_large_field_has_a_coarser_step():
    extent = Extent.of(SQUARE * 1000, 1.0)
    x, y = extent.axes()
    assert len(x) * len(y) <= 1_050_000


# Formulas


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_is_positive_and_deterministic(family):
    chosen = formula(family, **PARAMETERS[family])
    places = np.random.default_rng(0).uniform(-20, 60, (2000, 2))
    values = chosen.function(EXTENT)(places)
    assert values.shape == (2000,)
    assert values.min() > 0
    assert np.ptp(values) > 0.5
    np.testing.assert_array_equal(values, chosen.function(EXTENT)(places))


@pytest.mark.parametrize("family", ["gaussian_field", "exponential", "matern32", "patches", *UNEVEN])
def test_seeds_and_generators_differ(family):
    places = FieldGrid.from_polygon(SQUARE, 2.0).cells
    one, two = (formula(family, seed=seed, **PARAMETERS[family]).function(EXTENT)(places) for seed in (1, 2))
    drawn = formula(family, **PARAMETERS[family]).function(EXTENT, np.random.default_rng(9))(places)
    assert np.abs(one - two).max() > 0.1
    assert np.abs(one - drawn).max() > 0.1


@pytest.mark.parametrize(
    ("family", "more", "place", "expected"),
    [
        ("half", {"angle_deg": 90}, [[20, 0], [20, 15], [20, 30]], [3, 3.5, 4]),
        ("half", {"offset_m": 5}, [[25, 3]], [3.5]),
        ("gradient", {}, [[-9, 1], [0, 1], [20, 9], [40, 1], [99, 1]], [3, 3, 3.5, 4, 4]),
        ("gradient", {"angle_deg": 180}, [[0, 1], [40, 1]], [4, 3]),
        ("ridge", {"width_m": 3}, [[20, 0], [20, 30], [23, 7], [0, 7]], [4, 4, 3 + np.exp(-0.5), 3]),
        ("ridge", {"width_m": 3, "offset_m": 5}, [[25, 7]], [4]),
    ],
)
def test_shapes(family, more, place, expected):
    values = formula(family, **PARAMETERS[family], **more).function(EXTENT)(np.array(place, float))
    np.testing.assert_allclose(values, expected, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["gaussian", "exponential", "matern32"])
def test_random_fields_have_the_variance_and_correlation_of_their_model(model):
    x, y = np.arange(24.0), np.arange(18.0)
    rng = np.random.default_rng(11)
    draws = np.array([random_field(x, y, model, 6.0, rng) for _ in range(2000)])
    here, lags = draws[:, 2, 3], [(2, 4), (8, 3), (6, 9), (17, 23)]
    # The standard error of a variance or correlation from 2000 draws is at most sqrt(2 / 2000) = 0.032.
    assert here.var() == pytest.approx(1.0, abs=0.11)
    assert draws.var(axis=0).mean() == pytest.approx(1.0, abs=0.06)
    assert draws.mean() == pytest.approx(0.0, abs=0.05)
    for row, column in lags:
        expected = MODELS[model].correlation(np.array([((row - 2) ** 2 + (column - 3) ** 2) / 36.0]))[0]
        assert np.mean(here * draws[:, row, column]) == pytest.approx(expected, abs=0.1)


def test_a_random_field_with_a_hopeless_range_is_refused():
    with pytest.raises(ValueError, match="use a shorter range or larger cells"):
        random_field(np.arange(300.0), np.arange(300.0), "matern32", 4000.0, np.random.default_rng(0))


def test_formula_values_have_the_given_mean_and_spread():
    chosen = formula("exponential", mean=4.0, sd=0.8, range_m=2.0)
    cells = FieldGrid.from_polygon(SQUARE * 4, 2.0).cells
    values = chosen.function(Extent.of(SQUARE * 4, 2.0))(cells)
    assert values.mean() == pytest.approx(4.0, abs=0.1)
    assert values.std() == pytest.approx(0.8, abs=0.08)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            {"family": "gausian_field"},
            r"unknown family 'gausian_field'; known are .*did you mean 'gaussian_field'\?",
        ),
        ({"family": "half", "low": 1, "hihg": 2}, r"has no parameter 'hihg'; it has .*did you mean 'high'\?"),
        ({"family": "half", "low": 1}, "high\n  Field required"),
        ({"family": "half", "low": 0, "high": 2}, "greater than 0"),
        ({"family": "matern32", "mean": 4, "sd": 2}, r"'sd' must be at most a quarter of 'mean' \(1\)"),
        ({"family": "half", "low": 8, "high": 20, "quantity": "vwc"}, "'low' is a moisture in m3/m3"),
    ],
)
def test_bad_formulas_are_refused(parameters, message):
    with pytest.raises(ValidationError, match=message):
        formula(**parameters)
