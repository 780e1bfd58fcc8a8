# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("rclpy")

from std_msgs.msg import String

from msg_adapters.model import Model, model_from_message, model_to_message
from soilmoist_ros.mapping import Samples, Variogram
from soilmoist_ros.mapping.drift import Change, Changing, Drift, TimedSamples
from soilmoist_ros.mapping.samples import path_spread
from soilmoist_ros.mapping.variogram.fit import VariogramFit, estimate_variogram
from soilmoist_ros.mapping.variogram.model import BUILT_IN as MODELS

numbers = st.floats(allow_infinity=False, allow_nan=False)
positive = st.floats(1e-300, 1e300)
three = st.tuples(numbers, numbers, numbers)
arrays = st.lists(st.floats(allow_infinity=False), max_size=4).map(np.array)
fits = st.builds(
    VariogramFit,
    variogram=st.builds(
        lambda model, nugget, range_m, partial, *direction: Variogram(
            model, nugget, range_m, nugget + partial, *direction
        ),
        st.sampled_from(sorted(MODELS)),
        st.floats(0, 1e100),
        positive,
        st.floats(0, 1e100),
        st.floats(1, 1e100),
        st.floats(-400, 400),
    ),
    method=st.sampled_from(["reml", "soft_l1"]),
    mean_rate=st.floats(allow_infinity=False),
    n_samples=st.integers(1, 10_000),
    objective=st.floats(allow_infinity=False),
    log_sd=st.none() | three,
    prior_share=three,
    converged=st.booleans(),
    lag_m=arrays,
    gamma=arrays,
    weight=arrays,
    edges_m=arrays,
)


def assert_equal(found, wanted):
    for field in dataclasses.fields(VariogramFit):
        value, expected = getattr(found, field.name), getattr(wanted, field.name)
        if isinstance(expected, Variogram):
            assert value == expected
        else:
            np.testing.assert_array_equal(value, expected, strict=isinstance(expected, np.ndarray))


@pytest.mark.slow
@settings(deadline=None)
@given(fits, st.floats(0, 2e9))
def test_a_fit_comes_back_exactly(fit, stamp_s):
    found = model_from_message(model_to_message(Model(fit, stamp_s, 2.5)))
    assert (found.stamp_s, found.cell_m) == (stamp_s, 2.5)
    assert_equal(found.fit, fit)


def test_a_local_rate_comes_back_exactly():
    rng = np.random.default_rng(1)
    xy = rng.uniform(0, 50, (9, 2))
    fit = estimate_variogram(xy, rng.poisson(400, 9), np.full(9, 100.0), local_noise=True)
    content = model_to_message(Model(fit, 0.0, 2.0))
    found = model_from_message(content).fit
    np.testing.assert_array_equal(found.local_rate(xy), fit.local_rate(xy), strict=True)
    rate = {"mean": 4.0, "least": 0.4, "x": [1.0], "y": [], "coefficients": [0.1]}
    broken = {**json.loads(content.data), "local_rate": rate}
    with pytest.raises(ValueError, match="local_rate must have finite pools"):
        model_from_message(String(data=json.dumps(broken)))


def drifting(is_jump=False):
    rng = np.random.default_rng(2)
    xy, counts, exposure_s = rng.uniform(0, 50, (12, 2)), rng.poisson(400, 12), rng.uniform(60, 100, 12)
    samples = Samples(xy, counts, exposure_s, np.tile(path_spread((3.0, 1.0)), (12, 1)))
    timed = TimedSamples(samples, 1.78e9 + np.sort(rng.uniform(0, 7200, 12)))
    times_s = 1.78e9 + np.linspace(0, 7200, 5)
    shares, *components = (tuple(one) for one in rng.normal(0, 0.1, (3, 5)).tolist())
    drift = Drift(0.93, is_jump, tuple(times_s.tolist()), shares, tuple(components))
    fit = estimate_variogram(xy, counts, exposure_s, local_noise=True)
    return fit, Changing(timed, Change(drift), 1.78e9 + 7200)


@pytest.mark.parametrize("is_jump", [False, True])
def test_a_drift_and_its_samples_come_back_exactly(is_jump):
    fit, changing = drifting(is_jump)
    found = model_from_message(model_to_message(Model(fit, changing.now_s, 2.5, changing)))
    assert (found.changing.change, found.changing.now_s) == (changing.change, changing.now_s)
    np.testing.assert_array_equal(found.changing.timed.time_s, changing.timed.time_s)
    for name in ("xy", "counts", "exposure_s", "spread"):
        value, wanted = (getattr(each.timed.samples, name) for each in (found.changing, changing))
        np.testing.assert_array_equal(value, wanted, strict=True)


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"shares": [float("nan")] * 5}, "drift must have finite numbers"),
        ({"times_s": [5.0, 4.0, 3.0, 2.0, 1.0]}, "rising times_s"),
        ({"components": [[0.1]]}, "columns of equal length"),
        ({"samples": {}}, "no key 'x'"),
        ({"time_s": [None] * 12}, "drift must have finite numbers"),
        ({"effective_exposure_s": [-1.0] * 12}, "exposure_s must be > 0"),
    ],
)
def test_an_impossible_drift_is_refused(changes, problem):
    content = json.loads(model_to_message(Model(drifting()[0], 1.0, 2.5, drifting()[1])).data)
    drift = content["drift"]
    for name, value in changes.items():
        (drift if name in drift else drift["samples"])[name] = value
    with pytest.raises(ValueError, match=problem):
        model_from_message(String(data=json.dumps(content)))


def good(**changes):
    nothing = np.empty(0)
    variogram = Variogram("matern32", 0.1, 20.0, 1.0)
    fit = VariogramFit(variogram, "reml", 4.0, 3, -1.0, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), True, *4 * [nothing])
    return json.dumps({**json.loads(model_to_message(Model(fit, 1.0, 2.0)).data), **changes})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the model is not JSON"),
        ("[" * 100_000, "the model is not JSON"),
        ("[1]", "the model is not a JSON object"),
        ("{}", "the model has no key 'stamp_s'"),
        ('{"stamp_s": 1, "cell_m": 2}', "the model has no key 'model'"),
        (good(model="cubic"), "there is no variogram model 'cubic'"),
        (good(range_m=0), "range_m must be > 0"),
        (good(nugget=math.inf), "nugget must be finite"),
        (good(method="guess"), "unknown method 'guess'"),
        (good(log_sd=[1.0]), "values to unpack"),
        (good(stamp_s=math.nan), "stamp_s must be finite"),
        (good(cell_m=0.0), "cell_m must be > 0"),
        (good(n_samples=math.inf), "a value of another kind"),
    ],
)
def test_what_is_no_model_is_refused(text, message):
    none = model_to_message(Model(None, 3.5, 2.0))
    assert json.loads(none.data) == {"model": None, "n_samples": 0, "stamp_s": 3.5, "cell_m": 2.0}
    assert model_from_message(none) == Model(None, 3.5, 2.0), "which is said before the first fit"
    with pytest.raises(ValueError, match=message):
        model_from_message(String(data=text))
