# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The watchdog: its decisions at given times, and real planners that are killed, stopped or stuck."""

import os
import re
import signal
import sys
import time
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import Bool
from test_planner import Planning
from virtual_navigation import FIELD, RouteServer, VirtualNavigation, World, make_map

from soilmoist_ros.exploration import Phase, route_graph_text
from soilmoist_ros.nodes.topics import DEFAULT, LATCHED
from soilmoist_ros.nodes.watchdog import AGAIN_S, ALL_GOALS, ALL_S, FIRST_S, RELEASE_S, TICK_S, Heartbeats

SILENT_S = float(os.environ.get("WATCHDOG_SILENT_S", "2.5"))
"""Limit of the real watchdogs [s]: above the default, as machines that run tests are busy."""
STOPPED_S = float(os.environ.get("PLANNER_STOPPED_S", "7"))
"""Time for which a planner is stopped [s]; after 5 s it would take its navigation for gone."""
GOAL = ("/topological_navigation", b"planner's goal id")
STUCK = """
import ctypes, signal
# A call of the C library that keeps Python's lock, as a faulty extension would: no thread of the process goes on.
signal.signal(signal.SIGUSR1, lambda *_: ctypes.PyDLL(None).sleep(600))
from soilmoist_ros.nodes.planner import main
main()
"""


def run(beats, until_s, *, from_s=0.0, beat_every_s=None, goals=(GOAL,), topic="", good=True):
    """Ticks of a watch, with heartbeats if any; times and goals of what was cancelled."""
    cancelled, steps = [], round((until_s - from_s) / TICK_S)
    for step in range(steps):
        now_s = from_s + step * TICK_S
        if beat_every_s and step % round(beat_every_s / TICK_S) == 0:
            beats.hear(topic, good, now_s)
        cancelled += [(now_s, goal) for goal in beats.tick(frozenset(goals), now_s)]
    return cancelled


def test_a_silent_planner_loses_its_goal_within_a_second_and_again_until_it_ends():
    beats = Heartbeats(0.8, {}, 0.0)
    assert run(beats, 10.0, beat_every_s=0.2) == []
    cancelled = run(beats, 16.0, from_s=10.0)
    times = [now_s for now_s, goal in cancelled if goal == GOAL]
    assert 10.0 < times[0] < 11.0
    assert all(AGAIN_S <= later - earlier < 3 * AGAIN_S for earlier, later in pairwise(times))
    others = [now_s for now_s, goal in cancelled if goal == (GOAL[0], ALL_GOALS)]
    assert others[0] >= times[0] + ALL_S, "all goals only where the planner's own does not end"


@given(st.floats(0.1, 30.0), st.sampled_from([0.2, 0.4, 0.6]))
def test_it_holds_until_goals_are_over_and_the_planner_is_heard_again(silent_s, every_s):
    beats = Heartbeats(0.8, {}, 0.0)
    run(beats, 6.0, beat_every_s=0.2)
    run(beats, 8.0, from_s=6.0)
    assert beats.tripped
    run(beats, 8.0 + silent_s, from_s=8.0, goals=())
    assert beats.tripped, "a planner that is not there is no reason to let go"
    back_s = 8.0 + silent_s
    assert run(beats, back_s + 2 * AGAIN_S, from_s=back_s, beat_every_s=every_s), (
        "its goals are cancelled meanwhile"
    )
    run(beats, back_s + RELEASE_S, from_s=back_s + 2 * AGAIN_S, beat_every_s=every_s, goals=())
    assert beats.tripped
    run(beats, back_s + RELEASE_S + 1.0, from_s=back_s + RELEASE_S, beat_every_s=every_s, goals=())
    assert not beats.tripped


def test_without_a_goal_nothing_is_cancelled_and_a_planner_that_never_came_is_waited_for():
    beats = Heartbeats(0.8, {}, 0.0)
    assert run(beats, 60.0, goals=()) == []
    assert not beats.tripped
    [(first_s, _), *_] = run(Heartbeats(0.8, {}, 0.0), FIRST_S + 2.0)
    assert first_s > FIRST_S


@pytest.mark.parametrize("bad", [False, None], ids=["false", "missing"])
def test_another_heartbeat_counts_as_much(bad):
    beats = Heartbeats(0.8, {"/safety/heartbeat": 2.0}, 0.0)
    for step in range(round(10.0 / TICK_S)):
        now_s = step * TICK_S
        beats.hear("", True, now_s)
        if now_s < 5.0 or bad is not None:
            beats.hear("/safety/heartbeat", now_s < 5.0, now_s)
        cancelled = beats.tick(frozenset({GOAL}), now_s)
        assert beats.tripped >= bool(cancelled)
    assert "/safety/heartbeat" in beats.reason


def test_who_was_never_heard_is_no_good_sign():
    beats = Heartbeats(0.8, {"/x": 2.0}, 0.0)
    assert beats.fault(1.0) == ""
    assert beats.fault(1.0, first="has not been heard yet") == "the planner has not been heard yet"
    beats.hear("", True, 1.0)
    assert beats.fault(1.1, first="is missing") == "the heartbeat /x is missing"
    beats.hear("/x", False, 1.0)
    assert "/x says" in beats.fault(1.1, ["/x"])
    assert beats.fault(1.1, [""]) == ""


def test_its_own_sleep_is_not_taken_for_silence():
    beats = Heartbeats(0.8, {}, 0.0)
    run(beats, 6.0, beat_every_s=0.2)
    assert beats.tick(frozenset({GOAL}), 30.0) == frozenset(), "what came meanwhile is still to be read"
    assert run(beats, 32.0, from_s=30.05), "and then counts"


@pytest.mark.parametrize("way", ["killed", "stopped", "stuck"])
def test_the_robot_of_a_dead_planner_stops_and_waits_for_people(ros, tmp_path, way, record_property):
    heard, told = (
        ros.collect(DiagnosticStatus, "watchdog", LATCHED),
        ros.collect(Bool, "/warning/heartbeat", DEFAULT),
    )
    ros.start("watchdog", params={"heartbeat_out": "/warning/heartbeat", "silent_s": SILENT_S})
    given = {"journal_dir": str(tmp_path / "journal"), "hours": 2.0, "autostart": True}
    with World(ros, rate=3.0) as world, VirtualNavigation(ros, world) as navigation:
        first = Planning(ros, tmp_path, **given) if way != "stuck" else stuck(ros, tmp_path, given)
        ros.wait_for(lambda: told and told[-1].data, message="the watchdog to hear the planner")
        first.wait_phase(Phase.TRAVELLING)
        ros.wait_for(lambda: world.goal is not None, message="the robot to drive")
        number = {"killed": signal.SIGKILL, "stopped": signal.SIGSTOP, "stuck": signal.SIGUSR1}[way]
        goals = list(navigation.goals)
        since = time.monotonic()
        os.kill(first.process.process.pid, number)
        ros.wait_for(lambda: navigation._stopped, message="the cancellation", every=0.005)
        record_property("cancelled_after_s", time.monotonic() - since)
        ros.wait_for(lambda: world.goal is None, message="the robot to stand")
        ros.wait_for(lambda: heard and heard[-1].level == DiagnosticStatus.ERROR and not told[-1].data)
        assert "the planner is silent" in heard[-1].message
        if way == "stopped":
            time.sleep(max(0.0, since + STOPPED_S - time.monotonic()))
            os.kill(first.process.process.pid, signal.SIGCONT)
            again = first
        else:
            first.process.kill()
            again = Planning(ros, tmp_path, respawn_limit_s=600.0, **given)
        # A planner that wakes says how long it slept, until the watchdog's alarm reaches it.
        said = re.compile("the planner was silent for|planner is silent")
        again.wait(lambda status: status.phase is Phase.PAUSED and said.search(status.reason), "a pause")
        ros.wait_for(lambda: heard[-1].level == DiagnosticStatus.OK, message="the watchdog to let go")
        assert len(navigation.goals) == len(goals), "no goal before people resume"
        ros.wait_for(lambda: again.call("resume").success, message="people to be obeyed")
        ros.wait_for(lambda: len(navigation.goals) > len(goals), message="another goal")


def test_along_routes_of_nav2_the_fence_judges_each_and_the_watchdog_stops_both_servers(
    ros, tmp_path, record_property
):
    (tmp_path / "pond.yaml").write_text(f"{FIELD}no_go: [[[9, 9], [11, 9], [11, 11], [9, 11]]]\n")
    (tmp_path / "lanes.geojson").write_text(route_graph_text(make_map().graph))
    given = {"field": str(tmp_path / "pond.yaml"), "graph": str(tmp_path / "lanes.geojson"), "hours": 2.0}
    told = ros.collect(Bool, "/warning/heartbeat", DEFAULT)
    ros.start("watchdog", params={"heartbeat_out": "/warning/heartbeat", "silent_s": SILENT_S})
    with World(ros, rate=5.0) as world, RouteServer(ros, world, ((5.0, 5.0), (10.0, 10.0))) as navigation:
        start = world.place
        planning = Planning(ros, tmp_path, navigator="follow_route", autostart=True, **given)
        planning.wait(lambda status: "is not allowed: it enters no-go area 1 at (" in status.reason, "a refusal")
        assert (navigation.goals, world.place) == ([], start), "the robot has got no path"
        navigation.via = lambda stop: ((5.0, 5.0), (5.0, stop[1]))
        ros.wait_for(lambda: world.goal is not None, message="the robot to drive")
        ros.wait_for(lambda: told and told[-1].data, message="the watchdog to hear the planner")
        world.rate, since = 0.5, time.monotonic()
        planning.process.process.kill()
        ros.wait_for(lambda: navigation.ends == ["canceled"], message="the controller to stop", every=0.005)
        record_property("cancelled_after_s", time.monotonic() - since)
        ros.wait_for(lambda: navigation.tracked[-1:] == ["canceled"], message="the Route Server to end")
        assert world.goal is None


def stuck(ros, folder, given):
    """A planner that does not go on after SIGUSR1."""
    path = folder / "stuck_planner"
    path.write_text(f"#!{sys.executable}\n{STUCK}")
    path.chmod(0o755)
    return Planning(ros, folder, executable=str(path), **given)
