# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.foundation.configuration import resource_names
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.simulation.robot.scenario import Occasion, Scenario, Span, load_scenario


@pytest.mark.parametrize("name", resource_names("scenarios"))
def test_shipped_scenarios_have_a_title_and_faults(name):
    scenario = load_scenario(name)
    assert scenario.title != Scenario().title
    assert scenario.model_copy(update={"title": Scenario().title}) != Scenario()


def test_an_empty_name_means_no_faults():
    assert load_scenario("") == Scenario()


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(
        InputError, match=r"bad_link, bad_sensor, lost_sensor, nav2, rain, thorvald.*did you mean 'thorvald'"
    ):
        load_scenario("torvald")


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


def test_a_span_excludes_its_end():
    span = Span(at_s=10, for_s=5)
    assert [span.covers(time_s) for time_s in (9.9, 10, 14.9, 15)] == [False, True, True, False]
