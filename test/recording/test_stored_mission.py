# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a planner does with the mission that it finds."""

import errno
import os
from contextlib import closing
from dataclasses import replace

import pytest
from test_map_sources import recorded

from soilmoist_ros.exploration import Choice, Mission, MissionJournal, Stop, parse_dwell
from soilmoist_ros.exploration.mission.events import RESTART, AlarmOver, Command, GoalFailed, Moved, Planned, Tick
from soilmoist_ros.exploration.mission.types import Alarm, MissionRules, Phase, Response, Verb
from soilmoist_ros.recording.journal import ENTRIES, Journal
from soilmoist_ros.recording.stored_mission import MAX_CRASHES, WINDOW_S, ProcessMark, StoredMission

RULES = MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:60"))
STARTED = (Moved(1.0, 0.0, 0.0), Command(2.0, Verb.START))
PAUSED = (*STARTED, Command(3.0, Verb.PAUSE))
ABORTED = (*STARTED, Command(3.0, Verb.ABORT))


def run(folder, events, resume="ask", end=False, limit_s=60.0):
    stored = StoredMission(folder, RULES, resume, limit_s)
    recorded(stored.mission or Mission(RULES), stored.journal)(*events)
    if end:
        stored.close()
    else:
        stored.journal.close()
    return stored


def start(folder, resume="ask", limit_s=60.0):
    stored = StoredMission(folder, RULES, resume, limit_s)
    stored.journal.close()
    return stored


@pytest.mark.parametrize("resume", ["ask", "auto", "fresh"])
def test_after_a_crash_the_mission_goes_on_by_itself(tmp_path, resume):
    run(tmp_path, STARTED, resume)
    again = start(tmp_path, resume)
    assert again.mission.state.phase is Phase.PLANNING
    assert (again.resumes, again.starts) == (True, False)


def test_a_damaged_snapshot_forgets_no_mission_but_the_first(tmp_path):
    run(tmp_path, (*ABORTED, Moved(30.0, 0.0, 0.0), Moved(60.0, 0.0, 0.0), Command(61.0, Verb.START)))
    (tmp_path / "snapshot.json").write_bytes(b"{")
    again = start(tmp_path)
    assert again.mission is not None
    assert (again.resumes, again.starts) == (False, False), "entries are missing: people decide"
    assert again.mission.state.goal is not None, "the robot may be driving"
    (tmp_path / ENTRIES).write_bytes((tmp_path / ENTRIES).read_bytes().partition(b"\n")[0] + b"\n")
    again = start(tmp_path)
    assert (again.mission, again.left_driving) == (None, True), "it is stopped, whatever it does"


@pytest.mark.parametrize("resume", ["ask", "auto"])
def test_a_pause_that_a_full_disk_refused_is_kept_by_people_after_a_crash(tmp_path, monkeypatch, resume):
    def refuse(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    stored = StoredMission(tmp_path, RULES, resume, 60.0)
    take = recorded(Mission(RULES), stored.journal)
    take(*STARTED)
    with monkeypatch.context() as full:
        for name in ("_write", "write_whole"):
            full.setattr(f"soilmoist_ros.recording.journal.{name}", refuse)
        take(PAUSED[-1])
    assert "No space" in take.journal.problem
    stored.journal.close()
    again = start(tmp_path, resume)
    assert again.mission is not None
    assert not again.resumes
    assert any("refused" in problem for problem in again.problems)
    again.mission.step(Command(4.0, Verb.PAUSE, who=RESTART))
    assert again.mission.state.phase is Phase.CANCELLING, "the robot may be driving to a goal that was not written"
    assert again.mission.state.goal is not None

    stored = StoredMission(tmp_path, RULES, resume, 60.0)  # with space again, the next snapshot makes up for it
    mission = stored.mission
    take = recorded(mission, stored.journal)
    take(Command(4.0, Verb.PAUSE, who=RESTART))
    take(GoalFailed(5.0, mission.state.goal.goal_id, "cancelled"), Moved(6.0, 0.0, 0.0), Moved(30.0, 0.0, 0.0))
    assert mission.state.phase is Phase.PAUSED
    take(Command(31.0, Verb.RESUME))
    stored.journal.close()
    assert start(tmp_path, resume).resumes


@pytest.mark.parametrize(
    ("resume", "resumes", "found"), [("ask", False, True), ("auto", True, True), ("fresh", False, False)]
)
def test_after_an_end_on_request_resume_decides(tmp_path, resume, resumes, found):
    run(tmp_path, STARTED, end=True)
    again = start(tmp_path, resume)
    assert (again.resumes, again.mission is not None, again.starts) == (resumes, found, not found)


def test_a_mission_that_is_forgotten_may_have_left_the_robot_driving(tmp_path):
    plan = Planned(3.0, 1, Choice(Stop("a", 20.0, 0.0), "a test"))
    run(tmp_path / "driving", (*STARTED, plan), end=True)
    run(tmp_path / "standing", STARTED, end=True)
    run(tmp_path / "unreadable", STARTED).journal.close()
    with closing(Journal.open(tmp_path / "unreadable")) as journal:
        journal.snapshot("a mission of a later version")
    left = {folder.name: start(folder, "fresh", 0.0).left_driving for folder in tmp_path.iterdir()}
    assert left == {"driving": True, "standing": False, "unreadable": True}
    assert not start(tmp_path / "driving", "ask").left_driving, "it is taken up, which stops the robot"


def test_a_paused_mission_waits_for_the_operator(tmp_path):
    run(tmp_path, PAUSED)
    again = start(tmp_path)
    assert again.mission is not None
    assert not again.resumes


def test_a_pause_by_a_restart_is_nobodys_but_one_by_people_lasts(tmp_path):
    restart = (*STARTED, Command(3.0, Verb.PAUSE, who=RESTART))
    run(tmp_path / "restart", restart)
    assert start(tmp_path / "restart").resumes
    run(tmp_path / "people", (*restart, Command(4.0, Verb.PAUSE)))
    assert not start(tmp_path / "people", "auto").resumes
    run(tmp_path / "before", (*PAUSED, Command(4.0, Verb.PAUSE, who=RESTART)))
    assert not start(tmp_path / "before", "auto").resumes
    run(tmp_path / "later", (*restart, Command(4.0, Verb.RESUME), Command(5.0, Verb.PAUSE)))
    assert not start(tmp_path / "later", "auto").resumes


def test_a_hold_by_the_guard_does_not_end_by_itself_after_a_power_cut(tmp_path):
    held = (*STARTED, Alarm(3.0, "fix_age", Response.HOLD, "no fix"), Command(4.0, Verb.PAUSE, who=RESTART))
    run(tmp_path, held)
    stored = start(tmp_path)
    stored.mission.step(AlarmOver(5.0, "fix_age"))
    stored.mission.step(Tick(6.0))
    assert (stored.mission.state.phase, stored.resumes) == (Phase.PAUSED, True)


def test_an_emergency_stop_outlives_a_crash(tmp_path):
    stored = run(tmp_path, STARTED)
    mission = Mission(RULES)
    for event in STARTED:
        mission.step(event)
    mission.state = replace(mission.state, emergency=("button",))
    (tmp_path / "snapshot.json").unlink(missing_ok=True)
    with_stop = StoredMission(tmp_path, RULES, "ask", 60.0)
    MissionJournal(with_stop.journal).keep(mission)
    with_stop.journal.close()
    assert stored.starts
    again = start(tmp_path)
    assert again.mission.state.emergency == ("button",)
    assert not again.resumes


def test_a_crash_after_the_end_of_a_mission_starts_no_other_one(tmp_path):
    assert run(tmp_path, ABORTED).starts
    assert not start(tmp_path).starts
    assert not start(tmp_path, "fresh").starts


NOW_S, LIMIT_S = 1.78e9, 60.0


@pytest.fixture
def marked(tmp_path):
    """Starts a process at a time [s]; the journal was written last at another."""

    def make(after_s, wrote_s=None, boot="b1", limit_s=LIMIT_S):
        journal = tmp_path / ENTRIES
        journal.touch()
        wrote_s = NOW_S + (after_s - 1.0 if wrote_s is None else wrote_s)
        os.utime(journal, (wrote_s, wrote_s))
        mark = ProcessMark(tmp_path, limit_s, NOW_S + after_s, boot)
        mark.write(ended=False)
        return mark

    return make


def test_a_crash_is_recognised_until_the_limit(marked):
    marked(0.0)
    assert marked(20.0, wrote_s=15.0).after_crash
    assert not marked(200.0, wrote_s=130.0).after_crash


@pytest.mark.parametrize(("end", "boot", "limit_s"), [(True, "b1", 60.0), (False, "b2", 60.0), (False, "b1", 0.0)])
def test_ends_on_request_power_cuts_and_no_limit_are_no_crashes(marked, end, boot, limit_s):
    first = marked(0.0)
    if end:
        first.write(ended=True)
    assert not marked(10.0, boot=boot, limit_s=limit_s).after_crash


def test_a_process_that_crashes_again_and_again_is_not_trusted(marked):
    marked(0.0)
    assert [marked(10.0 * number).after_crash for number in range(1, 6)] == [True] * MAX_CRASHES + [False] * 2
    assert marked(60.0 + WINDOW_S).after_crash
