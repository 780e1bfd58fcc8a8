# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The mission that a planner finds in its journal when it starts, and whether it goes on by itself."""

from __future__ import annotations

from pathlib import Path

from soilmoist_ros.exploration import EVENT, Mission, MissionRules, interrupted_mission, state_from_json
from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.journal import Journal, LoadedJournal, load_journal
from soilmoist_ros.recording.process_mark import ProcessMark


class StoredMission:
    """A journal that is opened by a planner, and the mission in it.

    A planner that a launch file starts again after a crash goes on by itself, unless the mission was paused or
    stopped by people, or its journal lacks entries that a full disk refused. After a power cut, an end on request
    or repeated crashes ``resume`` decides. A mission that it forgets may have left the robot driving.

    :param folder: folder of the journal; ``None`` for no journal
    :param rules: what governs the mission from now on
    :param resume: ``ask``, ``auto`` or ``fresh``
    :param respawn_limit_s: longest time since the crash [s]; 0 to recognise none
    :raises InputError: if the journal cannot be read or written

    Attributes
    ----------
    journal : Journal | None
        the open journal
    mission : Mission | None
        the mission that was under way
    resumes : bool
        whether it goes on as soon as all that it needs is there
    starts : bool
        whether a new mission may start by itself: not if one ended before a crash
    left_driving : bool
        whether the robot may still be driving to a goal of a mission that is forgotten
    problems : tuple[str, ...]
        problems of the journal, in words
    """

    def __init__(self, folder: Path | None, rules: MissionRules, resume: str, respawn_limit_s: float) -> None:
        self.journal: Journal | None = None
        self._mark: ProcessMark | None = None
        self.mission: Mission | None = None
        self.left_driving = False
        found, crashed = LoadedJournal(None, (), ()), False
        if folder is not None:
            mark = ProcessMark(folder, respawn_limit_s)  # first: opening the journal changes its time
            crashed = mark.after_crash
            forgets = resume == "fresh" and not crashed
            try:
                found = load_journal(folder)
                self.mission = _interrupted(rules, found)
            except InputError as error:
                if not forgets:
                    raise
                found, self.left_driving = LoadedJournal(None, (), (str(error),)), True
            if forgets and self.mission is not None:
                self.left_driving = self.mission.state.goal is not None
                self.mission = None
            self.journal = Journal.open(folder)
            mark.begin()
            self._mark = mark
        self.problems = found.problems
        waits = self.mission is not None and self.mission.state.waits_for_people
        trusted = found.complete and not waits
        self.resumes = self.mission is not None and trusted and (crashed or resume == "auto")
        ended = found.snapshot is not None and state_from_json(found.snapshot).ended is not None
        self.starts = self.mission is None and not (crashed and ended)

    def close(self) -> None:
        """The planner ends on request or with the mission."""
        if self.journal is not None and self._mark is not None:
            self._mark.end()
            self.journal.close()


def _interrupted(rules: MissionRules, found: LoadedJournal) -> Mission | None:
    events = (entry.payload for entry in found.entries if entry.kind == EVENT)
    return interrupted_mission(rules, found.snapshot, events, found.complete)
