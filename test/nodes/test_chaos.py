# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The real nodes under faults, and what the judge of the rehearsals must find in what was heard and witnessed.

Messages take their time: a state of the mission counts if it lasts from before to after.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_left, bisect_right
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import yaml

pytest.importorskip("rclpy")
pytest.importorskip("topological_navigation_msgs")
from real_nodes import UNLIMITED, RealNodes

from rehearsal.cases import Ground
from rehearsal.judge import Judge, Kind, Limits
from soilmoist_ros.exploration import Phase, Verb
from soilmoist_ros.foundation import InputError
from soilmoist_ros.foundation.configuration import config_folder
from soilmoist_ros.pipeline.field_survey import open_survey
from soilmoist_ros.recording import BagReader, recover_bag
from soilmoist_ros.recording.map_records import MapRecords
from soilmoist_ros.recording.map_sources import DRIVER, OWN, RecordTail
from soilmoist_ros.simulation.mission.settings import MissionSettings

TIME_FACTOR, BUDGET_S, OVERTIME_S = 20.0, 900.0, 1200.0  # a killed node is back after minutes of simulated time
WALL_S = 600.0  # longest time of a run [s of the wall clock]
AFTERWARDS_S = 30.0
ANSWER_S = 40.0  # people resume a mission that has been paused for this time [s]
BACK_AFTER_S = 1.5  # a killed node is started again after this time [s of the wall clock], as by a launch file
LATE_S = 0.5 * TIME_FACTOR  # how late messages may be on a busy machine [s]
ROUNDING_S = 1e-6  # seconds since 1970 are known to 1.2e-7: what was heard may seem so much later than it was [s]
LEFT_BYTES = 3000  # what a disk that is nearly full still takes
GARBAGE = ("garbage", "wrong_checksum", "cut_short", "no_checksum")


def field_with_pond(folder):
    """The field of patches with a no-go area in its middle, as a file; returns its path."""
    content = yaml.safe_load((config_folder() / "fields" / "patches.yaml").read_text())
    corners = np.mean(content["polygon"], axis=0) + 6.0 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    path = folder / "patches_pond.yaml"
    path.write_text(yaml.safe_dump(content | {"no_go": [corners.tolist()]}))
    return str(path)


def damages(from_s, for_s):
    """Scenario in which every second line of logger and receiver is damaged."""
    return {
        link: {
            "damages": [
                {"nth": number, "kind": GARBAGE[number // 2 % 4]}
                for number in range(1 + int(from_s / every_s), int((from_s + for_s) / every_s), 2)
            ]
        }
        for link, every_s in (("logger", 10.0), ("gnss", 1.0))
    }


class People:
    """Who pause a mission, and resume one that has been paused for a while."""

    def __init__(self, nodes):
        self.acts = []  # in their order: the time [s], and what stopped the robot; nothing for a resume
        self._nodes, self._paused_s = nodes, math.inf

    def pause(self):
        if self._nodes.ask(Verb.PAUSE):
            self.acts.append((self._nodes.now_s, Verb.PAUSE))

    def answer(self):
        now_s, status = self._nodes.now_s, self._nodes.status
        paused = status is not None and status.phase is Phase.PAUSED
        self._paused_s = min(self._paused_s, now_s) if paused else math.inf
        if now_s > self._paused_s + ANSWER_S:
            self._paused_s = math.inf
            if self._nodes.ask(Verb.RESUME):
                self.acts.append((now_s - ROUNDING_S, ""))  # a goal that follows at once is not before it


def faults(nodes, people):
    """What happens when [s], besides the damaged lines."""

    def kill(name):
        nodes.kill(name)
        time.sleep(BACK_AFTER_S)
        nodes.start(name)

    return [
        (30.0, partial(nodes.spoil, step_s=4 * 3600.0)), (40.0, partial(kill, "mapper")),
        (90.0, partial(nodes.spoil, left_bytes=LEFT_BYTES)), (150.0, partial(nodes.spoil, left_bytes=UNLIMITED)),
        (200.0, partial(kill, "sensor_driver")), (280.0, people.pause), (350.0, partial(kill, "planner")),
        (480.0, partial(nodes.spoil, step_s=-2500.0)),
    ]  # fmt: skip


def run(nodes, people):
    """Let the mission end while things go wrong."""
    todo, began_s, ended_s = faults(nodes, people), time.monotonic(), math.inf
    while nodes.now_s < BUDGET_S + OVERTIME_S and time.monotonic() - began_s < WALL_S:
        time.sleep(0.05)
        while todo and todo[0][0] <= nodes.now_s:
            todo.pop(0)[1]()
        people.answer()
        over = nodes.status is not None and nodes.status.phase is Phase.FINISHED
        ended_s = min(ended_s, nodes.now_s) if over else math.inf
        if nodes.ended() or nodes.now_s > ended_s + AFTERWARDS_S:
            break
    assert nodes.ended() == {}
    assert not todo
    nodes.stop()


def judged(nodes, acts, places, goals, records_of):
    """Violations, by the judge of the rehearsals."""
    end_s = nodes.now_s
    limits = Limits(stopping_s=10.0 + 2 * LATE_S, still_m=1.0, same_m=0.001, late_s=60.0 + LATE_S)
    judge = Judge(Ground("", nodes.field.field, None, (math.nan, math.nan)), BUDGET_S, limits)
    timeline = Timeline(nodes.statuses)
    events = []
    for (_, before), (at_s, place) in pairwise(places):
        if (status := timeline.at(at_s)) is not None:
            events.append((at_s, 3, partial(judge.drove, at_s, before, [place], status)))
    for number, (at_s, what) in enumerate(acts):  # what is done at one time keeps its order
        if what:  # goals that were on their way come later
            resumed_s = next((then_s for then_s, other in acts[number:] if not other), math.inf)
            events.append((min(at_s + LATE_S, resumed_s), 1, partial(judge.stopped, at_s, what)))
        else:
            events.append((at_s, 1, partial(judge.resumes, at_s, lambda: True)))
    begun = next(at_s for at_s, status in nodes.statuses if status.phase is not Phase.IDLE)
    events.append((begun - LATE_S, 0, partial(judge.resumes, begun, lambda: True)))
    events += [(at_s, 2, partial(judge.sent, at_s, place, name)) for at_s, place, name in goals]
    events += [(at_s, 4, partial(judge.said, at_s, status, 0.0)) for at_s, status in nodes.statuses]
    events += [(at_s, 5, partial(judge.visited, at_s, visit)) for at_s, visit in nodes.visits]
    for _, _, happen in sorted(events, key=lambda event: event[:2]):
        happen()
    judge.ended(end_s, nodes.status)
    logs = {name: records_of(nodes.session / name) for name in (DRIVER, OWN)}
    stored = [record for records in logs.values() for record in records]
    judge.kept(end_s, [*nodes.records, *nodes.quarantined], stored, "the logs")
    whole = MapRecords(open_survey(str(nodes.configuration / "field.yaml")).map)
    for name, records in logs.items():
        whole.take(name, records)
    judge.mapped(end_s, nodes.samples, whole.map.samples)
    for bag in nodes.bags:  # the full disk has spoilt them, but not invented anything
        with TemporaryDirectory() as folder, suppress(InputError):  # without a complete message
            recover_bag(bag, Path(folder, "bag"))
            with BagReader(Path(folder, "bag")) as reader:
                recorded = [record for _, record in reader.read_counts_of(["/counts"], "map")]
            judge.known(end_s, recorded, stored, f"the bag {bag.name}")
    return judge.violations


class Timeline:
    """What the mission said when; a state counts if it lasts. A starved listener misses some states."""

    def __init__(self, said):
        self._said = sorted(said, key=lambda one: one[0])
        self._times = [at_s for at_s, _ in self._said]

    def at(self, at_s):
        """What it said from before a time until after it; a neutral phase if phase or target changed."""
        first, last = bisect_left(self._times, at_s - LATE_S), bisect_right(self._times, at_s + LATE_S)
        if last == 0:
            return None
        latest = self._said[last - 1][1]
        around = [status for _, status in self._said[max(first - 1, 0) : last + 1]]
        same = all((one.phase, one.target) == (latest.phase, latest.target) for one in around)
        return latest if same else replace(latest, phase=Phase.PLANNING)


def records(folder):
    return RecordTail(folder, "map").read().records


@pytest.mark.slow
@pytest.mark.process
def test_no_record_is_lost_and_nobody_is_disobeyed(ros, tmp_path):
    """By a judge that finds what is wrong with the same evidence when it is spoiled."""
    mission = MissionSettings(field=field_with_pond(tmp_path), strategy="greedy", hours=BUDGET_S / 3600, seed=1)
    with RealNodes(ros, mission, TIME_FACTOR, damages(60.0, 60.0)) as nodes:
        people = People(nodes)
        run(nodes, people)
        places, goals = nodes.witnessed()
        assert judged(nodes, people.acts, places, goals, records) == []
        assert len(nodes.records) > 10
        assert goals
        assert [what for _, what in people.acts].count(Verb.PAUSE) == 1
        away = [(at_s, (x_m + 500.0, y_m)) for at_s, (x_m, y_m) in places]
        astray = [(at_s, (x_m + 500.0, y_m), name) for at_s, (x_m, y_m), name in goals]
        lost = judged(nodes, people.acts, away, astray, lambda file: records(file)[:5] + records(file)[6:])
    assert {Kind.LOST, Kind.MAP_DIFFERS, Kind.OUTSIDE, Kind.GOAL_OUTSIDE} <= {one.kind for one in lost}
