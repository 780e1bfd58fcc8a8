# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios of faults and of rain: scenario.py."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.foundation import InputError, resource_names
from soilmoist_ros.simulation import MissionSettings, load_scenario, simulate_mission, surrogate_field
from soilmoist_ros.simulation.robot.scenario import RAIN_S, Occasion, RateChange, RateDrift, Scenario
from soilmoist_ros.simulation.robot.virtual_devices import VirtualSensor


@pytest.mark.parametrize("name", resource_names("scenarios"))
def test_shipped_scenarios_have_a_title_and_faults(name):
    scenario = load_scenario(name)
    assert scenario.title != Scenario().title
    assert scenario.model_copy(update={"title": Scenario().title}) != Scenario()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("navigatoin: {}", r"1 \[navigatoin\]: unknown key.*did you mean 'navigation'"),
        ("navigation: {cancel: maybe}", r"\[navigation.cancel\].*'accepted' or 'looks_rejected'"),
        ("navigation: {localisation_delay_s: [3, 1]}", "shortest and the longest delay, in this order"),
        ("navigation:\n  goals:\n    - {nth: 0, kind: fails}", r":3 \[navigation.goals.0.nth\].*greater than or"),
        ("navigation: {goals: [{kind: fails}]}", "'nth' is missing"),
        ("logger: {outages: [{kind: cut, at_s: 5}]}", "'for_s' is missing"),
        ("logger: {damages: [{kind: burnt, nth: 1}]}", r"\[logger.damages.0.kind\].*'missing', 'twice'"),
        ("logger: {no_fix: []}", "unknown key 'no_fix'"),
    ],
)
def test_mistakes_are_reported_with_their_location(tmp_path, text, message):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        load_scenario(str(path))


@given(st.integers(1, 50), st.integers(1, 50), st.integers(1, 300))
def test_an_occasion_hits_nth_and_then_every_given_interval(nth, every, number):
    assert Occasion(nth=nth).hits(number) == (number == nth)
    assert Occasion(nth=nth, every=every).hits(number) == (number in range(nth, 301, every))


SHORT = MissionSettings(field="synthetic-low", hours=0.25, cell_m=5.0, strategy="random", dwell="fmi:60")


@pytest.mark.slow
@given(st.floats(-0.9, 2.0), st.floats(0, 1e4), st.floats(1, 1e4), st.floats(-1e4, 3e4))
def test_the_rate_goes_evenly_from_before_to_after(share, begin_s, over_s, time_s):
    factor = RateDrift(share, begin_s, begin_s + over_s).factor(time_s)
    assert min(1, 1 + share) <= factor <= max(1, 1 + share)
    if time_s <= begin_s:
        assert factor == 1
    if time_s >= begin_s + over_s:
        assert factor == 1 + share


def test_drying_takes_the_whole_mission_and_rain_five_minutes():
    assert replace(SHORT, hours=2, drift=0.1).rate_drift == RateDrift(0.1, 0, 7200)
    assert replace(SHORT, drift=-0.1, drift_hour=0.1).rate_drift == RateDrift(-0.1, 360, 360 + RAIN_S)
    assert RateChange(at_s=360, for_s=300, share=-0.1).drift == RateDrift(-0.1, 360, 660)


def test_counts_follow_the_drift():
    field, drift = surrogate_field("synthetic-low"), RateDrift(0.5, 0.0, 1e5)
    here = np.array([[30.0, 25.0]])
    sensor = VirtualSensor(field, np.random.default_rng(1), 100.0, weather=False, drift=drift)
    counts = [sensor.record(100.0 * (1 + number), here, (30.0, 25.0)).raw_counts for number in range(1000)]
    rate = float(field.rate_at(here)[0])
    early, late = sum(counts[:500]), sum(counts[500:])
    assert early == pytest.approx(50_000 * rate * 1.125, abs=4 * np.sqrt(early))
    assert late == pytest.approx(50_000 * rate * 1.375, abs=4 * np.sqrt(late))


@pytest.mark.slow
def test_the_truth_of_a_result_is_that_of_its_end():
    steady, rain = (
        simulate_mission(replace(SHORT, **drift)) for drift in ({}, {"drift": -0.2, "drift_hour": 0.05})
    )
    np.testing.assert_allclose(rain.truth_rate, 0.8 * steady.truth_rate, rtol=1e-12)
    assert rain.series[-1].mse == pytest.approx(np.nanmean((rain.soil_map.rate - rain.truth_rate) ** 2), rel=1e-9)
    # Until it rains, the counts are those of the other mission.
    before = [record.stamp_s <= 180 for record in rain.records]
    assert np.array(rain.records, object)[before].tolist() == np.array(steady.records, object)[before].tolist()
    assert sum(r.raw_counts for r in rain.records) < sum(r.raw_counts for r in steady.records)
