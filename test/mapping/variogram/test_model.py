# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Variogram models: correlations and anisotropy, also in maps."""

import dataclasses
import functools
import math
from importlib.metadata import EntryPoint
from unittest import mock

import mpmath
import numpy as np
import pydantic
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from soilmoist_ros.mapping import PoissonKriging, Samples, Variogram
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.mapping.variogram.model import (
    BUILT_IN,
    VARIOGRAM_MODELS,
    CorrelationModel,
    ModelName,
    isotropic_plane,
)
from soilmoist_ros.mapping.variogram.model import BUILT_IN as MODELS

EXACT = {
    "gaussian": lambda u: mpmath.exp(-(u**2)),
    "exponential": lambda u: mpmath.exp(-u),
    "spherical": lambda u: 1 - mpmath.mpf(3) / 2 * u + u**3 / 2 if u < 1 else mpmath.mpf(0),
    "matern32": lambda u: (1 + mpmath.sqrt(3) * u) * mpmath.exp(-mpmath.sqrt(3) * u),
    "matern52": lambda u: (1 + mpmath.sqrt(5) * u + 5 * u**2 / 3) * mpmath.exp(-mpmath.sqrt(5) * u),
}


@pytest.mark.parametrize("model", EXACT)
def test_correlation_against_forty_digits(model):
    h = [0.0, 1e-9, 0.3, 7.0, 39.99, 40.0, 55.5, 400.0]
    with mpmath.workdps(40):
        expected = [float(EXACT[model](mpmath.mpf(distance) / 40)) for distance in h]
    np.testing.assert_allclose(Variogram(model, 0.1, 40, 1.0).correlation(h), expected, rtol=2e-14, atol=1e-15)


@pytest.mark.parametrize("model", EXACT)
def test_slope_is_the_derivative_by_log_range(model):
    with mpmath.workdps(40):
        for u in (0.0, 0.2, 0.7, 1.5, 3.0):
            expected = mpmath.diff(lambda log_range, u=u: EXACT[model](u / mpmath.exp(log_range)), 0, h=1e-12)
            slope = MODELS[model].with_slope(np.array([u**2]))[1]
            assert slope[0] == pytest.approx(float(expected), abs=1e-9)


@pytest.mark.parametrize("model", EXACT)
def test_semivariance_and_covariance_fit_together(model):
    variogram = Variogram(model, 0.02, 40, 0.3)
    h = np.array([[0.0, 1e-6], [20.0, 1e6]])
    gamma = variogram.semivariance(h)
    assert gamma.shape == (2, 2)
    assert gamma[0, 0] == 0
    assert gamma[0, 1] == pytest.approx(0.02, abs=1e-6)
    assert gamma[1, 1] == pytest.approx(0.3)
    np.testing.assert_allclose(variogram.covariance(h), 0.3 - gamma, atol=1e-15)
    np.testing.assert_array_equal(variogram(h), gamma)
    assert variogram.structured_sill == pytest.approx(0.28)
    assert variogram.semivariance(3.0).shape == ()


@pytest.mark.parametrize("model", sorted(set(EXACT) - {"spherical"}))
def test_practical_range_is_where_five_per_cent_correlation_is_left(model):
    variogram = Variogram(model, 0.02, 40, 0.3)
    assert variogram.correlation(variogram.practical_range_m) == pytest.approx(0.05, rel=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("cubic", 0, 1, 1),
            "there is no variogram model 'cubic' -> use one of: gaussian, exponential, spherical",
        ),
        (("gaussian", -0.1, 1, 1), "nugget must be >= 0, got -0.1"),
        (("gaussian", 0, 0, 1), "range_m must be > 0, got 0.0"),
        (("gaussian", 0.5, 1, 0.4), "sill is the total sill and must be >= nugget"),
        (("gaussian", 0, np.inf, 1), "range_m must be finite, got inf"),
        (("gaussian", 0, 1, np.nan), "sill must be finite, got nan"),
        (("gaussian", 0, 1, 1, 0.5), "must be >= 1, got 0.5; turn angle_deg by 90 and give its inverse"),
        (("gaussian", 0, 1, 1, np.inf), "anisotropy must be finite, got inf"),
        (("gaussian", 0, 1, 1, 2, np.nan), "angle_deg must be finite, got nan"),
    ],
)
def test_variogram_refuses(arguments, message):
    with pytest.raises(ValueError, match=message):
        Variogram(*arguments)


def cauchy(q):
    return 1 / (1 + q)


def cauchy_with_slope(q):
    return cauchy(q), 2 * q / (1 + q) ** 2


CAUCHY = CorrelationModel(cauchy, cauchy_with_slope, 4.36, "Cauchy")
NOT_ONE = dataclasses.replace(CAUCHY, correlation=lambda q: 0 * q)


@pytest.fixture
def plug_in():
    def install(name):
        point = EntryPoint("cauchy", f"{__name__}:{name}", "soilmoist_ros.variogram_models")
        of_group = {point.group: [point]}  # pydantic asks for plug-ins of its own
        patch = mock.patch("importlib.metadata.entry_points", lambda *, group: of_group.get(group, []))
        patch.start()
        VARIOGRAM_MODELS.refresh()

    yield install
    mock.patch.stopall()
    VARIOGRAM_MODELS.refresh()


def test_a_model_of_another_package_is_fitted_and_known_by_name(plug_in):
    plug_in("CAUCHY")
    assert VARIOGRAM_MODELS.names() == [*BUILT_IN, "cauchy"]
    assert Variogram("cauchy", 0.0, 10.0, 1.0)(10.0) == pytest.approx(0.5)
    rng = np.random.default_rng(2)
    samples = Samples(rng.uniform(0, 60, (20, 2)), rng.poisson(400, 20), np.full(20, 100.0))
    fit = estimate_variogram(samples.xy, samples.counts, samples.exposure_s, "cauchy")
    assert fit.variogram.model == "cauchy"
    assert pydantic.TypeAdapter(ModelName).validate_python("cauchy") == "cauchy"


@pytest.mark.parametrize(
    ("name", "why"), [("cauchy", "must be a CorrelationModel"), ("NOT_ONE", "must be 1 at distance 0")]
)
def test_what_is_no_model_is_named(plug_in, name, why):
    plug_in(name)
    with pytest.raises(ValueError, match=why):
        Variogram("cauchy", 0.0, 10.0, 1.0)


def test_names_in_configuration_files_are_checked():
    with pytest.raises(pydantic.ValidationError, match=r"did you mean 'matern32'"):
        pydantic.TypeAdapter(ModelName).validate_python("matern3")


ratios = st.floats(1.0, 20.0)
angles = st.floats(-360.0, 360.0)


def stretched(xy, ratio, angle_deg):
    """Squeezed along a direction and stretched across, step by step: turned, scaled, turned back."""
    angle = math.radians(angle_deg)
    back = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return xy @ back * [ratio**-0.5, ratio**0.5] @ back.T


@functools.cache
def counted(ratio, angle_deg, n=120, seed=0):
    """Counts at random places of a random field with this direction."""
    truth = Variogram("matern32", 0.0, 15.0, 0.3)
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, 100.0, (n, 2))
    there = stretched(xy, ratio, angle_deg)
    covariance = truth.covariance(cdist(there, there)) + 1e-9 * np.eye(n)
    rate = np.maximum(4 + np.linalg.cholesky(covariance) @ rng.standard_normal(n), 0.3)
    return Samples(xy, rng.poisson(200 * rate), np.full(n, 200.0))


# -- the model -------------------------------------------------------------------------------------------


@pytest.mark.slow
@given(ratios, angles)
def test_the_range_is_the_geometric_mean_of_those_along_and_across(ratio, angle_deg):
    variogram = Variogram("matern32", 0.0, 20.0, 1.0, ratio, angle_deg)
    assert 0 <= variogram.angle_deg < 180
    angle = math.radians(angle_deg)
    along, across = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    for direction, range_m in ((along, 20 * ratio**0.5), (across, 20 / ratio**0.5)):
        assert np.linalg.norm(variogram.scaled(range_m * direction)) == pytest.approx(1, rel=1e-9)
    assert np.linalg.det(isotropic_plane(ratio, angle_deg)) == pytest.approx(1, rel=1e-9)


# -- kriging ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("model", "factor"), [("gaussian", 7 / 4), ("exponential", 3.0), ("spherical", 1.0)])
@pytest.mark.parametrize("ratio", [1.0, 3.0])
def test_long_exposure_is_ordinary_kriging_of_pykrige(model, factor, ratio):
    """PyKrige's range is the longest."""
    from pykrige.ok import OrdinaryKriging

    xy = np.random.default_rng(8).uniform(0, 200, (40, 2))
    rate = 3 + np.sin(xy[:, 0] / 40)
    exposure_s = np.full(40, 2.0**50)
    peer = OrdinaryKriging(
        *xy.T, rate, variogram_model=model,
        variogram_parameters={"psill": 0.28, "range": 40 * math.sqrt(ratio) * factor, "nugget": 0.02},
        anisotropy_scaling=ratio, anisotropy_angle=35.0, exact_values=True, pseudo_inv=False,
    )  # fmt: skip
    x_m, y_m = np.linspace(-20, 220, 25), np.linspace(-30, 230, 31)
    expected = peer.execute("grid", x_m, y_m)
    kriging = PoissonKriging(Variogram(model, 0.02, 40, 0.3, ratio, 35.0))
    found = kriging.fit(xy, np.rint(rate * exposure_s), exposure_s).predict_grid(x_m, y_m)
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-9)
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-8)


# -- fitting ---------------------------------------------------------------------------------------------


def fit(samples, **options):
    return estimate_variogram(samples.xy, samples.counts, samples.exposure_s, extent_m=100.0, **options)


@pytest.mark.slow
@pytest.mark.parametrize("angle_deg", [60, 90])
def test_a_clear_direction_is_found(angle_deg):
    samples = counted(6, angle_deg)
    plain, found = fit(samples, anisotropy=False), fit(samples)
    assert plain.variogram.anisotropy == 1
    assert found.variogram.anisotropy >= 2
    assert abs((found.variogram.angle_deg - angle_deg + 90) % 180 - 90) <= 22.5
    assert found.objective > plain.objective + 1.5
    assert found.variogram.range_m == pytest.approx(15, rel=0.5)


@pytest.mark.slow
def test_no_clear_direction_is_found_where_there_is_none():
    """One in ten may be, by chance."""
    clear = 0
    for seed in range(15):
        samples = counted(1, 0, 80, seed)
        plain, found = fit(samples, anisotropy=False), fit(samples)
        if found.variogram.anisotropy == 1:
            assert found.variogram == plain.variogram
            assert found.objective == plain.objective
        clear += found.variogram.anisotropy > 1.5
    assert clear <= 2


@pytest.mark.parametrize("turn_deg", [22.5, 90, 135])
def test_the_direction_turns_with_the_places(turn_deg):
    """By a multiple of the step between candidates, so that these are the same."""
    samples = counted(2, 30, 60)
    turn = np.radians(turn_deg)
    turned = samples.xy @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    found = fit(samples).variogram
    there = fit(Samples(turned, samples.counts, samples.exposure_s)).variogram
    assert 1.2 < found.anisotropy == pytest.approx(there.anisotropy, rel=1e-6)
    assert (there.angle_deg - found.angle_deg - turn_deg + 90) % 180 - 90 == pytest.approx(0, abs=1e-4)


def test_few_samples_have_no_direction():
    samples = counted(6, 60)
    few = Samples(samples.xy[:14], samples.counts[:14], samples.exposure_s[:14])
    assert fit(few).variogram == fit(few, anisotropy=False).variogram
