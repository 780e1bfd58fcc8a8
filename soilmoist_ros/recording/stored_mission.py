# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The mission that a planner finds in its journal when it starts, and whether it goes on by itself."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.exploration import EVENT, Mission, MissionRules, boot_id, interrupted_mission, state_from_json
from soilmoist_ros.foundation import InputError, read_json
from soilmoist_ros.recording.journal import ENTRIES, Journal, LoadedJournal, load_journal
from soilmoist_ros.recording.run_folder import write_whole

MARK: Final = "process.json"
MAX_CRASHES: Final = 3  # crashes within WINDOW_S after which a restart is not trusted
WINDOW_S: Final = 600.0


class ProcessMark:
    """Marks the folder of a journal while a process writes it.

    ``after_crash``: the process before crashed just now. It did not end by itself or on request, the computer has
    not booted since, its journal was written within ``limit_s`` (0: never), and it has not crashed repeatedly.
    """

    def __init__(self, folder: Path, limit_s: float, now_s: float | None = None, boot: str | None = None) -> None:
        self._path = folder / MARK
        now_s = time.time() if now_s is None else now_s
        boot = boot_id() if boot is None else boot
        before = _read_mark(self._path)
        same = before.get("boot") == boot and not before.get("ended", True)
        crashes = [at_s for at_s in before.get("crashes", ()) if same and 0 <= now_s - at_s < WINDOW_S]
        crashes += [now_s] if same else []
        journal = folder / ENTRIES
        age_s = now_s - journal.stat().st_mtime if journal.is_file() else float("inf")
        self.after_crash = same and abs(age_s) <= limit_s and len(crashes) <= MAX_CRASHES
        self._content: dict[str, Any] = {"boot": boot, "crashes": crashes}

    def write(self, ended: bool) -> None:
        """Mark that the journal is being written now, or that the process ends by itself or on request."""
        write_whole(self._path, json.dumps({**self._content, "ended": ended}).encode())


def _read_mark(path: Path) -> dict[str, Any]:
    try:
        content = read_json(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


class StoredMission:
    """A journal that is opened by a planner, and the mission in it.

    A planner that a launch file starts again after a crash goes on by itself, unless a goal drove the robot, the
    mission was paused or stopped by people, or its journal lacks entries that a full disk refused. After a power
    cut, an end on request or repeated crashes ``resume`` (``ask``, ``auto`` or ``fresh``) decides. A mission that
    it forgets may have left the robot driving.

    :param respawn_limit_s: longest time since the crash [s]; 0 to recognise none
    :raises InputError: if the journal cannot be read or written
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
                events = (entry.payload for entry in found.entries if entry.kind == EVENT)
                self.mission = interrupted_mission(rules, found.snapshot, events, found.complete)
            except InputError as error:
                if not forgets:
                    raise
                found, self.left_driving = LoadedJournal(None, (), (str(error),)), True
            if forgets and self.mission is not None:
                self.left_driving = self.mission.state.goal is not None
                self.mission = None
            self.journal = Journal.open(folder)
            mark.write(ended=False)
            self._mark = mark
        # entries are missing: nobody knows whether a goal is open
        self.left_driving |= self.mission is None and not found.complete
        self.problems = found.problems
        waits = self.mission is not None and self.mission.state.waits_for_people
        trusted = found.complete and not waits
        # a watchdog that lives has stopped a robot on its way, and people resume; so they do without it
        on_way = self.mission is not None and self.mission.state.goal is not None
        self.resumes = self.mission is not None and trusted and ((crashed and not on_way) or resume == "auto")
        ended = found.snapshot is not None and state_from_json(found.snapshot).ended is not None
        self.starts = self.mission is None and not (crashed and ended)

    def close(self) -> None:
        """The planner ends on request or with the mission."""
        if self.journal is not None and self._mark is not None:
            self._mark.write(ended=True)
            self.journal.close()
