# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Variogram models by name, and those of other packages."""

import dataclasses
from importlib.metadata import EntryPoint
from unittest import mock

import numpy as np
import pydantic
import pytest

from soilmoist_ros.mapping import Samples, Variogram
from soilmoist_ros.mapping.variogram import correlation
from soilmoist_ros.mapping.variogram.correlation import BUILT_IN, VARIOGRAM_MODELS, CorrelationModel, ModelName
from soilmoist_ros.mapping.variogram.fit import estimate_variogram


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
        patch = mock.patch("importlib.metadata.entry_points", return_value=[point])
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


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_models_pass_the_check_of_plug_ins(name):
    model = BUILT_IN[name]
    assert correlation._checked(model) is model
    assert model.label
