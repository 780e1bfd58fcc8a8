# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A mark in a folder by which a process that starts recognises that the one before has crashed."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.exploration import boot_id
from soilmoist_ros.foundation import read_json
from soilmoist_ros.recording.journal import ENTRIES
from soilmoist_ros.recording.whole_file import write_whole

MARK: Final = "process.json"
MAX_CRASHES: Final = 3
"""Crashes within :data:`WINDOW_S` after which a restart is not trusted."""
WINDOW_S: Final = 600.0


class ProcessMark:
    """Marks the folder of a journal while a process writes it.

    :param folder: folder of the journal
    :param limit_s: longest time since the crash [s]; 0 to recognise none
    :param now_s: time of day [s since 1970-01-01 UTC]
    :param boot: identifies the boot of the computer

    Attributes
    ----------
    after_crash : bool
        whether the process before crashed just now: it did not end by itself or on request, the computer has not
        booted since, its journal was written within the limit, and it has not crashed repeatedly
    """

    def __init__(self, folder: Path, limit_s: float, now_s: float | None = None, boot: str | None = None) -> None:
        self._path = folder / MARK
        now_s = time.time() if now_s is None else now_s
        boot = boot_id() if boot is None else boot
        before = _read(self._path)
        same = before.get("boot") == boot and not before.get("ended", True)
        crashes = [at_s for at_s in before.get("crashes", ()) if same and 0 <= now_s - at_s < WINDOW_S]
        crashes += [now_s] if same else []
        journal = folder / ENTRIES
        age_s = now_s - journal.stat().st_mtime if journal.is_file() else float("inf")
        self.after_crash = same and abs(age_s) <= limit_s and len(crashes) <= MAX_CRASHES
        self._content: dict[str, Any] = {"boot": boot, "crashes": crashes, "ended": False}

    def begin(self) -> None:
        """Mark the folder: the journal is being written now.

        :raises OSError: if the mark cannot be written
        """
        self._write()

    def end(self) -> None:
        """The process ends by itself or on request.

        :raises OSError: if the mark cannot be written
        """
        self._content["ended"] = True
        self._write()

    def _write(self) -> None:
        write_whole(self._path, json.dumps(self._content).encode())


def _read(path: Path) -> dict[str, Any]:
    try:
        content = read_json(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
