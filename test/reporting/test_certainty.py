# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.reporting.certainty import CERTAIN, calibration_state, certainty, class_probability
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

CURVE = CalibrationCurve(7.0, 1.4, n0_sd_cps=0.3)


@given(
    edges=st.lists(st.floats(0.05, 0.5), min_size=0, max_size=4, unique=True).map(sorted),
    rate=st.floats(2.7, 6.0),
    sd=st.floats(0.01, 1.0),
    relative=st.booleans(),
)
@settings(deadline=None)
def test_the_classes_share_all_probability_and_a_map_of_the_rate_agrees(edges, rate, sd, relative):
    rates, sds = np.array([rate]), np.array([sd])
    shares = [class_probability(rates, sds, n, edges, CURVE, relative)[0] for n in range(len(edges) + 1)]
    assert sum(shares) == pytest.approx(1.0, abs=1e-9)
    if relative:  # classes of the rate count the other way
        limits = CURVE.rate_cps(np.array(edges))[::-1]
        turned = [class_probability(rates, sds, n, limits, None, True)[0] for n in range(len(edges) + 1)]
        assert turned[::-1] == pytest.approx(shares, abs=1e-9)


def test_an_error_of_the_calibration_does_not_blur_places_of_one_map():
    rate, sd = CURVE.rate_cps(np.array([0.18])), np.array([0.02])
    alone, together = (class_probability(rate, sd, 0, [0.2], CURVE, relative)[0] for relative in (True, False))
    assert alone > 0.999
    assert 0.5 < together < CERTAIN, "N0 +- 4 % is more than the distance to the limit"
    assert class_probability(np.array([np.nan]), sd, 0, [0.2], CURVE, True)[0] == 0.0


def test_of_certain_places_and_zones_at_most_a_fifth_is_wrong():
    """Truths drawn from what the map states: the promise of 'certain' holds for places, and for the whole zone."""
    rng = np.random.default_rng(1)
    rate, sd = rng.normal(4.0, 0.4, 40_000), rng.uniform(0.05, 0.8, 40_000)
    number = (rate >= 4.0).astype(float)
    probability = class_probability(rate, sd, number, [4.0], None, True)
    right = (rng.normal(rate, sd) >= 4.0) == number
    sure = probability >= CERTAIN
    assert 0.2 < sure.mean() < 0.9
    assert right[sure].mean() > CERTAIN + 0.1
    found = certainty(probability)
    assert found.sure == sure.mean()
    assert right.mean() == pytest.approx(found.expected, abs=0.01)
    assert found.certain == (found.expected >= CERTAIN)
    assert not certainty(np.empty(0)).certain


def test_the_origin_of_a_calibration_has_one_word():
    states = [
        calibration_state(*given) for given in ((False, False, True), (True, False, True), (True, True, True))
    ]
    assert [*states, calibration_state(True, True, False)] == ["none", "illustrative", "simulated", "own"]
