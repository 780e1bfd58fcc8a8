# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Poisson kriging against answers computed elsewhere, and its properties."""

import json
import logging

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import IllConditionedError
from soilmoist_ros.mapping import PoissonKriging, Variogram
from soilmoist_ros.mapping.kriging.poisson_kriging import clip_negative
from soilmoist_ros.mapping.variogram.model import BUILT_IN as MODELS

MODEL = Variogram("matern32", 0.02, 40.0, 0.3)


def survey(n=30, seed=0, side=200.0):
    rng = np.random.default_rng(seed)
    return rng.uniform(0, side, (n, 2)), rng.poisson(900, n), rng.uniform(60, 600, n)


def targets(g=25, seed=99, side=200.0):
    return np.random.default_rng(seed).uniform(-0.2 * side, 1.2 * side, (g, 2))


# -- answers computed elsewhere --------------------------------------------------------------------------


def test_against_fifty_digits(reference_data):
    data = json.loads((reference_data / "poisson_kriging_cases.json").read_text())
    parameters = [float(data[key]) for key in ("nugget_p0", "range_p1", "sill_p2")]
    assert len(data["cases"]) == 20
    for case in data["cases"]:
        kriging = PoissonKriging(Variogram(case["model"], *parameters), keep_nugget=not case["nugget_filtered"])
        kriging.fit(data["points"], data["counts"], data["t"])
        assert kriging.noise_mean_rate == pytest.approx(float(data["m_hat"]), rel=1e-14)
        weights, lagrange = kriging.weights([case["target"]])
        rate, variance = kriging.predict([case["target"]])
        np.testing.assert_allclose(weights[:, 0], np.array(case["weights"], float), rtol=0, atol=1e-12)
        np.testing.assert_allclose(lagrange, float(case["mu"]), rtol=0, atol=1e-12)
        np.testing.assert_allclose(rate, float(case["mean"]), rtol=0, atol=1e-12)
        np.testing.assert_allclose(variance, float(case["variance"]), rtol=0, atol=1e-12)


def test_part_of_counting_against_fifty_digits(reference_data):
    """The squared weights times the Poisson noise, and the slope of the variance with the noise."""
    data = json.loads((reference_data / "poisson_kriging_cases.json").read_text())
    parameters = [float(data[key]) for key in ("nugget_p0", "range_p1", "sill_p2")]
    counts, exposure = np.array(data["counts"], float), np.array(data["t"], float)
    for case in data["cases"][::2]:
        variogram = Variogram(case["model"], *parameters)
        noise = float(data["m_hat"]) / exposure
        expected = float(np.array(case["weights"], float) ** 2 @ noise)
        variances = []
        for less in (1.0, 1 + 1e-6):
            kriging = PoissonKriging(variogram, not case["nugget_filtered"], float(data["m_hat"]))
            kriging.fit(data["points"], counts, exposure * less)
            variances.append(kriging.predict([case["target"]])[1][0])
            if less == 1:
                assert kriging.counting_variance([case["target"]])[0] == pytest.approx(expected, rel=1e-7)
        assert (variances[0] - variances[1]) / 1e-6 == pytest.approx(expected, rel=1e-3)


# -- properties ------------------------------------------------------------------------------------------


def test_the_raster_is_nan_outside_the_mask():
    kriging = PoissonKriging(MODEL).fit(*survey())
    mask = np.random.default_rng(1).random((5, 8)) < 0.4
    x_m, y_m = np.arange(8.0) * 20, np.arange(5.0) * 30
    for masked, full in zip(kriging.predict_grid(x_m, y_m, mask), kriging.predict_grid(x_m, y_m), strict=True):
        np.testing.assert_allclose(masked[mask], full[mask], rtol=1e-13)
        assert np.isnan(masked[~mask]).all()


def test_tiles_leave_no_seam(monkeypatch):
    kriging = PoissonKriging(MODEL).fit(*survey())
    wanted = np.vstack([targets(53), kriging.places.xy])
    whole, done = kriging.predict(wanted), []
    weights = kriging.weights(wanted)
    monkeypatch.setattr("soilmoist_ros.mapping.kriging.system._TILE_ELEMENTS", 30 * 7)
    np.testing.assert_allclose(kriging.predict(wanted, done.append), whole, rtol=1e-12)
    np.testing.assert_allclose(kriging.weights(wanted)[0], weights[0], atol=1e-13)
    assert len(done) == 12
    assert done == sorted(done)
    assert done[-1] == 1.0


@given(st.floats(-1e5, 1e5), st.floats(-1e5, 1e5), st.floats(0, 2 * np.pi), st.randoms())
@settings(max_examples=25)
def test_shift_rotation_and_order_do_not_matter(east, north, angle, random):
    xy, counts, exposure_s = survey()
    order = list(range(len(xy)))
    random.shuffle(order)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def moved(places):
        return places @ turn.T + [east, north]

    expected = PoissonKriging(MODEL).fit(xy, counts, exposure_s).predict(targets())
    kriging = PoissonKriging(MODEL).fit(moved(xy)[order], counts[order], exposure_s[order])
    np.testing.assert_allclose(kriging.predict(moved(targets())), expected, rtol=1e-7)


@given(st.floats(1e-3, 1e3))
@settings(max_examples=20)
def test_the_unit_of_time_does_not_matter(seconds):
    xy, counts, exposure_s = survey()
    expected_rate, expected_variance = PoissonKriging(MODEL).fit(xy, counts, exposure_s).predict(targets())
    scaled = Variogram(MODEL.model, MODEL.nugget * seconds**2, MODEL.range_m, MODEL.sill * seconds**2)
    rate, variance = PoissonKriging(scaled).fit(xy, counts, exposure_s / seconds).predict(targets())
    np.testing.assert_allclose(rate, expected_rate * seconds, rtol=1e-10)
    np.testing.assert_allclose(variance, expected_variance * seconds**2, rtol=1e-10)


@given(st.integers(0, 29), st.floats(0.05, 0.95), st.floats(0, 1))
@settings(max_examples=30)
def test_a_record_split_in_two_is_the_same_record(index, share, counts_share):
    xy, counts, exposure_s = survey()
    part = round(counts_share * counts[index])
    split = (np.vstack([xy, xy[index]]), np.append(counts, part), np.append(exposure_s, share * exposure_s[index]))
    split[1][index] -= part
    split[2][index] *= 1 - share
    whole, halves = (PoissonKriging(MODEL).fit(*data) for data in ((xy, counts, exposure_s), split))
    np.testing.assert_allclose(halves.predict(targets()), whole.predict(targets()), rtol=1e-10)
    weights, lagrange = halves.weights(targets())
    expected_weights, expected_lagrange = whole.weights(targets())
    np.testing.assert_allclose(weights[index] + weights[-1], expected_weights[index], atol=1e-12)
    np.testing.assert_allclose(weights[-1], share * expected_weights[index], atol=1e-12)
    np.testing.assert_allclose(lagrange, expected_lagrange, atol=1e-12)
    np.testing.assert_allclose((split[1] / split[2]) @ weights, whole.predict(targets())[0], rtol=1e-10)


@pytest.mark.parametrize("model", MODELS)
def test_variance_grows_away_from_the_samples_up_to_its_far_value(model):
    kriging = PoissonKriging(Variogram(model, 0.02, 40, 0.3)).fit(*survey())
    far = kriging.predict([[1e6, 1e6]])
    variance = kriging.predict(targets(500))[1]
    assert variance.min() > 0
    assert variance.max() <= far[1][0] + 1e-12
    assert far[1][0] > 0.3
    assert far[0][0] == pytest.approx(kriging.map_mean)
    assert kriging.predict(kriging.places.xy)[1].max() < 0.1


def test_another_sample_never_raises_the_variance():
    xy, counts, exposure_s = survey()
    kriging = PoissonKriging(MODEL, mean_rate=3.0).fit(xy[:10], counts[:10], exposure_s[:10])
    before = kriging.predict(targets(200))[1]
    for k in range(10, 30):
        after = kriging.add(xy[k], counts[k], exposure_s[k]).predict(targets(200))[1]
        assert (after <= before + 1e-13).all()
        assert (after < before - 1e-6).any()
        before = after


# -- on line ---------------------------------------------------------------------------------------------


@given(st.lists(st.integers(1, 12), min_size=1, max_size=8), st.booleans())
@settings(max_examples=30)
def test_adding_is_fitting(sizes, revisits):
    xy, counts, exposure_s = survey(sum(sizes) + 1, seed=sum(sizes))
    if revisits:
        xy = np.random.default_rng(len(sizes)).permutation(xy)[np.arange(len(xy)) // 2]
    kriging = PoissonKriging(MODEL, mean_rate=3.0).fit(xy[:1], counts[:1], exposure_s[:1])
    done = 1
    for size in sizes:
        part = slice(done, done + size)
        kriging.add(xy[part], counts[part], exposure_s[part])
        done += size
    expected = PoissonKriging(MODEL, mean_rate=3.0).fit(xy, counts, exposure_s)
    np.testing.assert_allclose(kriging.predict(targets()), expected.predict(targets()), rtol=1e-10)
    np.testing.assert_allclose(kriging.weights(targets())[0], expected.weights(targets())[0], atol=1e-11)


def test_a_refused_addition_leaves_the_kriging_as_it_was():
    kriging = PoissonKriging(MODEL).fit(*survey())
    before = kriging.predict(targets())
    with pytest.raises(ValueError, match="exposure_s must be > 0"):
        kriging.add([5, 5], 30, 0.0)
    np.testing.assert_array_equal(kriging.predict(targets()), before)


# -- degenerate input ------------------------------------------------------------------------------------


def test_no_samples_are_refused():
    with pytest.raises(ValueError, match="at least one sample"):
        PoissonKriging(MODEL).fit(np.empty((0, 2)), [], [])
    with pytest.raises(RuntimeError, match=r"call fit\(\) first"):
        PoissonKriging(MODEL).predict([[0, 0]])


def test_one_sample_is_its_rate_everywhere():
    kriging = PoissonKriging(MODEL).fit([[0, 0]], [30], [10])
    rate, variance = kriging.predict([[0, 0], [20, 0], [1e5, 0]])
    np.testing.assert_allclose(rate, 3)
    noise = 3 / 10
    np.testing.assert_allclose(variance, 2 * MODEL.semivariance([0, 20, 1e5]) + noise, rtol=1e-12)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    ("xy", "counts", "exposure_s"),
    [
        (np.column_stack([np.arange(20.0), 2 * np.arange(20.0)]), np.arange(20) + 30, np.full(20, 10.0)),
        (np.zeros((5, 2)), [1, 2, 3, 4, 5], np.full(5, 10.0)),
        (np.eye(2), [0, 0], [10, 10]),
        ([[0, 0], [1e-9, 0], [0, 1e-9]], [30, 31, 29], [1e6, 1e6, 1e6]),
        ([[0, 0], [500, 0]], [10**9, 1], [1e9, 1e-3]),
    ],
    ids=["collinear", "one place", "zero counts", "nearly one place", "extreme exposures"],
)
def test_degenerate_samples_give_finite_maps(model, xy, counts, exposure_s):
    kriging = PoissonKriging(Variogram(model, 0.02, 40, 0.3)).fit(xy, counts, exposure_s)
    rate, variance = kriging.predict(np.vstack([xy, targets()]))
    assert np.isfinite(rate).all()
    assert np.isfinite(variance).all()
    assert variance.min() >= 0


def test_zero_counts_still_have_noise():
    kriging = PoissonKriging(MODEL).fit([[0, 0], [50, 0]], [0, 0], [10, 10])
    assert kriging.noise_mean_rate == 0.5 / 20
    rate, variance = kriging.predict([[0, 0]])
    assert rate == 0
    assert variance > 0


def test_a_variogram_without_variance_gives_the_mean_of_all_counts():
    kriging = PoissonKriging(Variogram("gaussian", 0, 40, 0)).fit([[0, 0], [50, 0]], [10, 50], [10, 20])
    rate, variance = kriging.predict([[10, 0]])
    assert rate == pytest.approx(60 / 30)
    assert variance == pytest.approx(2.0 / 30)


def test_a_hopeless_matrix_gets_jitter_and_says_so(caplog):
    xy = np.column_stack([np.linspace(0, 1, 40), np.zeros(40)])
    counts, exposure_s = np.full(40, 3 * 10**17), np.full(40, 1e17)
    with caplog.at_level(logging.WARNING):
        kriging = PoissonKriging(Variogram("gaussian", 0, 100, 0.3)).fit(xy, counts, exposure_s)
    assert 0 < kriging.jitter < 1e-8
    assert "ill-conditioned" in caplog.text
    assert kriging.predict([[0.51, 0]])[0] == pytest.approx(3, rel=1e-6)


def test_negative_variances_are_clipped_counted_and_reported(caplog):
    variance = np.array([0.1, -1e-3, 0.2, -1e-17])
    with caplog.at_level(logging.WARNING):
        assert clip_negative(variance, 0.3) == 2
    np.testing.assert_array_equal(variance, [0.1, 0, 0.2, 0])
    assert "2 negative variances" in caplog.text
    kriging = PoissonKriging(MODEL).fit(*survey())
    kriging.predict(targets())
    assert kriging.clipped_variances == 0


def test_a_matrix_beyond_help_is_an_error_with_a_remedy(monkeypatch):
    monkeypatch.setattr("soilmoist_ros.mapping.kriging.system.JITTER", (0.0,))
    xy = np.column_stack([np.linspace(0, 1, 40), np.zeros(40)])
    with pytest.raises(IllConditionedError, match=r"40 samples is not positive definite.*use matern32"):
        PoissonKriging(Variogram("gaussian", 0, 100, 0.3)).fit(xy, np.full(40, 3 * 10**17), np.full(40, 1e17))


def test_predict_refuses_bad_targets():
    kriging = PoissonKriging(MODEL).fit(*survey())
    with pytest.raises(ValueError, match=r"xy must have shape \(n, 2\)"):
        kriging.predict([[0, 0, 0]])
    with pytest.raises(ValueError, match="x_m must be a finite vector"):
        kriging.predict_grid([[0, 1]], [0, 1])
    with pytest.raises(ValueError, match=r"mask must have shape \(1, 2\)"):
        kriging.predict_grid([0, 1], [0], np.ones((2, 2), bool))
    with pytest.raises(ValueError, match="mean_rate must be positive"):
        PoissonKriging(MODEL, mean_rate=0.0)


@pytest.mark.parametrize("keep_nugget", [True, False])
def test_rate_and_covariance_together_are_those_of_a_prediction(keep_nugget):
    rng = np.random.default_rng(4)
    xy = rng.uniform(0, 50, (30, 2))
    kriging = PoissonKriging(Variogram("matern32", 0.1, 12.0, 0.8, 2.0, 30.0), keep_nugget)
    kriging.fit(xy, rng.poisson(400, 30), np.full(30, 100.0), rng.uniform(0, 2, (30, 1)) * [1.0, 0.0, 1.0])
    places = np.vstack([rng.uniform(0, 50, (20, 2)), xy[:5]])
    rate, covariance = kriging.rate_and_covariance(places)
    np.testing.assert_allclose(rate, kriging.predict(places)[0], rtol=1e-12)
    np.testing.assert_allclose(
        np.diag(covariance)[:20], kriging.predict(places)[1][:20] - 0.1 * keep_nugget, rtol=1e-9
    )
