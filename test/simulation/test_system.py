# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.sensing.formats.logger_reader import RecordParser
from soilmoist_ros.sensing.formats.robot_logger import FORMAT_NAME
from soilmoist_ros.sensing.position.nmea import NmeaParser
from soilmoist_ros.simulation import GoalEnded, MissionSettings, Sent, simulate_mission
from soilmoist_ros.simulation.robot.scenario import load_scenario
from soilmoist_ros.simulation.system import GNSS, LOGGER, PropertyCounted, VirtualSystem

START_S = 1_780_000_000.0
SETTINGS = MissionSettings(field="half-wet", seed=5, travel="graph", cell_m=2.0)


def advance(system, to_s):
    (outputs,) = system.advance(to_s)
    return outputs


def stream(outputs, link):
    return b"".join(output.data for output in outputs if isinstance(output, Sent) and output.link == link)


def records(outputs):
    parser = RecordParser(FORMAT_NAME)
    found = [parser.feed(line) for line in stream(outputs, LOGGER).splitlines(keepends=True)]
    return [record for record in found if record is not None], parser.problems


def fixes(outputs):
    parser = NmeaParser()
    found = [parser.feed(line) for line in stream(outputs, GNSS).splitlines(keepends=True)]
    return [fix for fix in [*found, parser.flush()] if fix is not None], parser.problems


@pytest.mark.slow
def test_counts_equal_those_of_a_mission_without_ros():
    choices = {
        "dwell": "fmi:90", "hours": 0.5, "strategy": "random", "footprint_m": 10.0,
        "properties": ("rough", "smooth"),
    }  # fmt: skip
    settings = replace(SETTINGS, **choices)
    mission = simulate_mission(settings)
    goals = [
        (float(match[1]), match[2])
        for text in mission.log
        if (match := re.match(r" *(\d+) s  go to (\S+):", text)) is not None
    ]
    assert len(goals) > 8
    system = VirtualSystem(settings, START_S)
    outputs = []
    for time_s, target in goals:
        outputs += advance(system, time_s)
        system.robots[0].go_to(target)
    outputs += advance(system, mission.records[-1].stamp_s)
    found, problems = records(outputs)
    assert problems == []
    assert [sum(record.tube_counts) for record in found] == [record.raw_counts for record in mission.records]
    assert [record.stamp_s - START_S for record in found] == [record.stamp_s for record in mission.records]
    further = [output for output in outputs if isinstance(output, PropertyCounted)]
    expected = [(mapped.name, record) for mapped in mission.properties[1:] for record in mapped.records]
    assert {name for name, _ in expected} == {"rough", "smooth"}
    for output, (name, there) in zip(sorted(further, key=lambda one: one.name), expected, strict=True):
        here = output.record
        assert output.name == name
        assert here.stamp_s == START_S + there.stamp_s
        # Both positions have noise of 2 cm; everything else is equal.
        assert (here.x_m, here.y_m) == pytest.approx((there.x_m, there.y_m), abs=0.2)
        assert replace(here, stamp_s=there.stamp_s, x_m=there.x_m, y_m=there.y_m) == there


@pytest.mark.slow
@settings(deadline=None, max_examples=10)
@given(
    st.lists(st.floats(0.01, 120), min_size=1, max_size=10), st.sampled_from(["", "bad_link", "nav2", "thorvald"])
)
def test_the_output_does_not_depend_on_the_number_of_steps(steps, scenario):
    def outputs(times):
        system = VirtualSystem(SETTINGS, START_S, scenario=load_scenario(scenario))
        system.robots[0].go_to(system.map.graph.names[-1])
        return [output for time_s in times for output in advance(system, time_s)]

    times = np.cumsum(steps)
    assert outputs(times) == outputs(times[-1:])


@pytest.mark.slow
def test_a_bad_link_loses_records_but_changes_none():
    good = {record.record_number: record for record in records(advance(VirtualSystem(SETTINGS, START_S), 2400))[0]}
    bad, problems = records(advance(VirtualSystem(SETTINGS, START_S, scenario=load_scenario("bad_link")), 2400))
    assert problems
    assert 0.8 * len(good) < len(bad) < len(good)
    for record in bad:
        assert replace(record, line=0) == replace(good[record.record_number], line=0)


@pytest.mark.slow
def test_a_receiver_can_be_wrong_without_a_word():
    good, _ = fixes(advance(VirtualSystem(SETTINGS, START_S), 700))
    bad, _ = fixes(advance(VirtualSystem(SETTINGS, START_S, scenario=load_scenario("bad_fixes")), 700))
    frame = VirtualSystem(SETTINGS, START_S).field.frame
    for true, seen in zip(good, bad, strict=True):
        places = [frame.to_local(fix.position.latitude_deg, fix.position.longitude_deg)[0] for fix in (true, seen)]
        shift = (2000.0, -300.0) if 600 <= true.stamp_s - START_S < 630 else (0.0, 0.0)
        assert places[1] - places[0] == pytest.approx(shift, abs=0.1)
        assert (seen.status, seen.quality) == (true.status, true.quality)


@pytest.mark.slow
def test_several_robots_count_like_those_of_a_mission_without_ros():
    settings = replace(SETTINGS, robots=3, dwell="fmi:90", hours=0.3, strategy="random", weather=True)
    mission = simulate_mission(settings)
    system = VirtualSystem(settings, START_S)
    outputs = [[] for _ in system.robots]

    def until(time_s):
        for its, new in zip(outputs, system.advance(time_s), strict=True):
            its += new

    end_s = min(float(text.split()[0]) for text in mission.log if "end: " in text)
    for text in mission.log:
        if (match := re.match(r" *(\d+) s  robot (\d): go to (\S+):", text)) and float(match[1]) <= end_s:
            until(float(match[1]))
            system.robots[int(match[2]) - 1].go_to(match[3])
    until(end_s)
    found = [[sum(record.tube_counts) for record in records(its)[0]] for its in outputs]
    assert found[0] != found[1]
    counts = [record.raw_counts for record in mission.records if record.stamp_s <= end_s]
    assert sorted(count for its in found for count in its) == sorted(counts)


def test_time_can_stop_when_a_record_is_sent_or_a_goal_ends():
    system = VirtualSystem(replace(SETTINGS, robots=2), START_S)
    system.robots[1].go_to(system.map.graph.names[-1])
    stops = []
    while system.now_s < 300:
        (_, outputs) = system.advance(300, step_by_step=True)
        stops.append((system.now_s, any(isinstance(output, GoalEnded) for output in outputs)))
        assert all(robot.now_s == system.now_s for robot in system.robots)
    (arrival_s,) = (time_s for time_s, ended in stops if ended)
    assert [time_s for time_s, _ in stops] == sorted({*np.arange(10.0, 301.0, 10.0), arrival_s})
