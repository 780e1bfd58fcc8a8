# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A process recognises a crash of the one before."""

import os

import pytest

from soilmoist_ros.recording.journal import ENTRIES
from soilmoist_ros.recording.stored_mission import MARK, MAX_CRASHES, WINDOW_S, ProcessMark

NOW_S, LIMIT_S = 1.78e9, 60.0


@pytest.fixture
def start(tmp_path):
    """Starts a process at a time [s]; the journal was written last at another."""

    def make(after_s, wrote_s=None, boot="b1", limit_s=LIMIT_S):
        journal = tmp_path / ENTRIES
        journal.touch()
        wrote_s = NOW_S + (after_s - 1.0 if wrote_s is None else wrote_s)
        os.utime(journal, (wrote_s, wrote_s))
        mark = ProcessMark(tmp_path, limit_s, NOW_S + after_s, boot)
        mark.begin()
        return mark

    return make


def test_the_first_start_is_after_no_crash(start):
    assert not start(0.0).after_crash


def test_a_crash_is_recognised_until_the_limit(start):
    start(0.0)
    assert start(20.0, wrote_s=15.0).after_crash
    assert not start(200.0, wrote_s=130.0).after_crash


@pytest.mark.parametrize(("end", "boot", "limit_s"), [(True, "b1", 60.0), (False, "b2", 60.0), (False, "b1", 0.0)])
def test_ends_on_request_power_cuts_and_no_limit_are_no_crashes(start, end, boot, limit_s):
    first = start(0.0)
    if end:
        first.end()
    assert not start(10.0, boot=boot, limit_s=limit_s).after_crash


def test_a_process_that_crashes_again_and_again_is_not_trusted(start):
    start(0.0)
    assert [start(10.0 * number).after_crash for number in range(1, 6)] == [True] * MAX_CRASHES + [False] * 2
    assert start(60.0 + WINDOW_S).after_crash


def test_a_damaged_mark_is_no_crash(start, tmp_path):
    for text in ("", "{", "[1]"):
        (tmp_path / MARK).write_text(text)
        assert not start(5.0).after_crash
