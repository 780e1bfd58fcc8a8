# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The map after any sequence of kills equals the map of everything that was published.

Tests map_sources.py and map_records.py with real files, without processes.
"""

from __future__ import annotations

import errno
import math
import os
import shutil
import tempfile
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration import Command, Mission, MissionJournal, MissionRules, Moved, RecordArrived, Verb
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping import FieldGrid, FieldMap
from soilmoist_ros.recording import START, TEAM_S, MapRecords, map_sources
from soilmoist_ros.recording.journal import ENTRIES, Journal, load_journal
from soilmoist_ros.recording.map_records import RECEIVED
from soilmoist_ros.recording.map_sources import DRIVER, SESSION, MapSources, RecordLog, RecordTail, open_session
from soilmoist_ros.sensing.position.place_doubt import Doubt, DoubtOutcome
from soilmoist_ros.sensing.records import CountRecord

GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], cell_m=10.0)
RULES = MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:60"))


def published(n, seed=1):
    rng = np.random.default_rng(seed)
    xy = np.cumsum(rng.normal(0, 3, (n, 2)), axis=0) % [60, 50]
    return [
        CountRecord(1.78e9 + 10 * i, *map(float, np.float32(xy[i])), 30.0, int(rng.poisson(40)), 10.0, 9.5)
        for i in range(n)
    ]


def recorded(mission, pages):
    """Takes events into a mission and the journal of its pages."""
    journal = MissionJournal(pages)

    def happens(*events):
        for event in events:
            journal.note(mission, event)
            mission.step(event)
            journal.keep(mission)

    happens.journal = journal
    return happens


def expected(records):
    """The map of everything, made by a mapper that is never killed."""
    field_map = FieldMap(GRID)
    for record in records:
        field_map.add(record)
    return field_map


def require_equal(field_map, records):
    full = expected(records)
    assert field_map.state.records == len(records)
    for name in ("xy", "counts", "exposure_s", "spread"):
        np.testing.assert_array_equal(getattr(field_map.state.samples, name), getattr(full.state.samples, name))


class System:
    """Driver and mapper that share a disk; the mapper dies at any time.

    :param folder: the disk
    :param driver: whether the driver stores records; otherwise it is of another make
    """

    def __init__(self, folder, driver):
        self.session = folder / "session"
        self.driver = RecordLog(self.session / DRIVER, "map") if driver else None
        self.sources, self.records = None, []
        self.start()

    def start(self):
        if self.sources is None:
            self.field_map = FieldMap(GRID)
            self.sources = MapSources(MapRecords(self.field_map), self.session)

    def kill(self):
        if self.sources is not None:
            self.sources.close()
            self.sources = None

    def publish(self, record, heard=True):
        """Publish a record; a mapper that has just started may not hear it."""
        if self.driver is not None:
            self.driver.write([record])
        if self.sources is not None and heard:
            self.sources.received([record])
        if self.driver is not None or (self.sources is not None and heard):
            self.records.append(record)

    def end(self):
        """The map of a mapper that is started when everything is over."""
        self.kill()
        self.start()
        return self.field_map


STEPS = st.lists(st.sampled_from(["publish", "publish unheard", "kill", "start"]), min_size=5, max_size=40)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(STEPS, st.booleans())
def test_the_map_after_any_kills_is_the_map_of_everything_published_or_heard(steps, driver):
    with tempfile.TemporaryDirectory() as folder:
        system = System(Path(folder), driver)
        for step, record in zip(steps, published(len(steps)), strict=True):
            if step.startswith("publish"):
                system.publish(record, heard=step == "publish")
            else:
                getattr(system, step)()
        require_equal(system.end(), system.records)


def test_a_record_of_several_sources_counts_once_and_twins_of_one_source_twice():
    many = published(4)
    twin = replace(many[1], z_m=math.nan)
    field_map = FieldMap(GRID)
    records = MapRecords(field_map)
    assert records.take(RECEIVED, [many[0], twin, twin]) == [many[0], twin, twin]
    assert records.take("bag", [many[0], twin, many[3]]) == [many[3]]
    assert records.take("log", [many[2], twin, twin]) == [many[2]]
    assert field_map.state.records == 5
    assert [one.stamp_s for one in field_map.track] == sorted(one.stamp_s for one in field_map.track)


def test_a_copy_of_another_robots_log_brings_what_an_outage_has_cost(tmp_path):
    """It grows meanwhile, as by rsync, and some of its records were heard."""
    many = published(12)
    other, copy = tmp_path / "other", tmp_path / "session" / "robot_2"
    log, field_map = RecordLog(other, "map"), FieldMap(GRID)
    sources = MapSources(MapRecords(field_map, TEAM_S), tmp_path / "session", "map")
    sources.received([many[0], many[11]])
    for end in (6, 12):
        log.write(many[end - 6 : end])
        shutil.copytree(other, copy, dirs_exist_ok=True)
        sources.poll()
        sources.poll()
        assert sorted(one.stamp_s for one in field_map.track) == sorted(
            {one.stamp_s for one in (*many[:end], many[11])}
        )
    log.close()
    sources.close()


def test_a_reset_outlives_a_restart(tmp_path):
    system = System(tmp_path, driver=True)
    many = published(9)
    for record in many[:5]:
        system.publish(record)
    system.sources.reset()
    assert system.field_map.state.records == 0
    for record in many[5:7]:
        system.publish(record, heard=False)
    system.sources.poll()
    assert system.field_map.state.records == 2
    system.kill()
    system.publish(many[7])
    system.publish(many[8])
    require_equal(system.end(), many[5:])


def test_a_line_that_is_being_written_is_read_later(tmp_path):
    many = published(3)
    with_nan = replace(many[1], x_m=math.nan, y_m=math.nan)
    log = RecordLog(tmp_path / "log", "map")
    log.write([many[0], with_nan])
    path, tail = tmp_path / "log" / ENTRIES, RecordTail(tmp_path / "log", "map")
    whole = path.read_bytes()
    path.write_bytes(whole[:-20])
    assert tail.read().records == many[:1]
    assert tail.read().records == []
    path.write_bytes(whole)
    (found,) = tail.read().records
    assert repr(found) == repr(with_nan)
    log.close()
    assert RecordTail(tmp_path / "none", "map").read().records == []


def test_records_of_another_frame_stay_out(tmp_path):
    many = published(2)
    for frame in ("map", "odom"):
        with_frame = RecordLog(tmp_path / "session" / frame, frame)
        with_frame.write(many[: 1 if frame == "map" else 2])
        with_frame.close()
    sources = MapSources(MapRecords(field_map := FieldMap(GRID)), tmp_path / "session")
    assert field_map.state.records == 1
    sources.close()


def test_two_mappers_cannot_share_a_session(tmp_path):
    first = MapSources(MapRecords(FieldMap(GRID)), tmp_path)
    with pytest.raises(InputError, match="another"):
        MapSources(MapRecords(FieldMap(GRID)), tmp_path)
    first.close()


def test_a_full_disk_leaves_the_map_as_it_is_and_is_a_problem(tmp_path, monkeypatch):
    sources = MapSources(MapRecords(field_map := FieldMap(GRID)), tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr("os.fdatasync", refuse(errno.ENOSPC))
        sources.received(published(1))
    assert field_map.state.records == 1
    assert "No space left" in sources.problem
    sources.received(published(2))
    assert sources.problem == ""
    sources.close()


def test_a_session_goes_on_while_its_mission_is_interrupted(tmp_path):
    root, folder = tmp_path / "records", tmp_path / "journal"
    first = open_session(root, folder, fresh=False)
    assert open_session(root, None, fresh=False) != first
    newest = open_session(root, folder, fresh=False)
    with Journal.open(folder) as pages:
        happens = recorded(Mission(RULES), pages)
        happens(
            Moved(1.77e9, 0.0, 0.0), RecordArrived(1.77e9, published(1)[0]), Command(1.78e9, Verb.START)
        )  # fmt: skip
        assert open_session(root, folder, fresh=False) == newest
        assert open_session(root, folder, fresh=True) != newest
        happens(Command(1.79e9, Verb.ABORT))
    assert open_session(root, folder, fresh=False) not in (first, newest)


def test_a_clock_that_was_set_back_does_not_resume_an_earlier_session(tmp_path, monkeypatch):
    root, folder = tmp_path / "records", tmp_path / "journal"
    (root / "20270101_090000_000000").mkdir(parents=True)
    (root / "20270101_090000_000000" / SESSION).write_text("no JSON")
    opened = []
    for month in (7, 3):
        monkeypatch.setattr(map_sources, "datetime", Mock(now=lambda month=month: datetime(2026, month, 1, 9)))
        opened.append(open_session(root, folder, fresh=False))
    with Journal.open(folder) as pages:
        happens = recorded(Mission(RULES), pages)
        happens(Moved(1.77e9, 0.0, 0.0), Command(1.78e9, Verb.START))
    assert [session.name[:6] for session in opened] == ["202607", "202603"]
    assert open_session(root, folder, fresh=False) == opened[-1]


def refuse(code):
    def call(*_):
        raise OSError(code, os.strerror(code))

    return call


class Disk:
    """The disk of one file, which refuses what its fault says.

    ``full`` takes nothing, ``half`` half of a line; a sync fails by ``sync``, and by ``dropped`` what was not
    synced before is gone, as after a power cut; ``read-only`` takes nothing, and does not even shorten the file.
    """

    def __init__(self, patch, path):
        self.fault, self._path, self._synced = "", path, 0
        self._write, self._sync, self._cut = os.write, os.fdatasync, os.ftruncate
        for name, call in (("write", self.write), ("fdatasync", self.sync), ("ftruncate", self.cut)):
            patch.setattr(os, name, call)

    def write(self, descriptor, data):
        if self.fault == "half":
            self._write(descriptor, bytes(data)[: len(data) // 2])
        if self.fault in ("full", "half", "read-only"):
            refuse(errno.ENOSPC)()
        return self._write(descriptor, data)

    def sync(self, descriptor):
        if self.fault == "dropped":
            os.truncate(self._path, self._synced)
        if self.fault:
            refuse(errno.EIO)()
        self._sync(descriptor)
        self._synced = self._path.stat().st_size

    def cut(self, descriptor, size):
        if self.fault == "read-only":
            refuse(errno.EROFS)()
        self._cut(descriptor, size)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.sampled_from(["", "full", "half", "sync", "dropped", "read-only"]), max_size=10))
@example(["sync", "read-only", "read-only", "dropped", "half", ""])
def test_records_that_the_disk_refuses_are_written_later_once_and_in_order(faults):
    records = published(len(faults) + 2)
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        log, tail = RecordLog(Path(folder), "map"), RecordTail(Path(folder), "map")
        disk, found = Disk(patch, Path(folder) / ENTRIES), []
        for record, disk.fault in zip(records, ["", *faults, ""], strict=True):
            try:
                log.write([record])
            except OSError:
                assert disk.fault
            assert log.waits == bool(disk.fault)
            found += tail.read().records
        assert found == RecordTail(Path(folder), "map").read().records == records
        assert [entry.seq for entry in load_journal(Path(folder)).entries] == list(range(1, len(records) + 1))
        log.close()


def test_a_log_that_is_closed_writes_what_waits(tmp_path, monkeypatch, caplog):
    records, log = published(3), RecordLog(tmp_path, "map")
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", refuse(errno.ENOSPC))
        with pytest.raises(OSError, match="No space"):
            log.write(records)
    log.close()
    assert RecordTail(tmp_path, "map").read().records == records
    log = RecordLog(tmp_path, "map")
    monkeypatch.setattr(os, "write", refuse(errno.ENOSPC))
    with pytest.raises(OSError, match="No space"):
        log.write(published(1, seed=2))
    log.close()
    assert "1 records are lost" in caplog.text


# Doubts about the places of several robots, and the records of logs, which do not say whose they are ------------


def of_robot(robot, number):
    return CountRecord(1.78e9 + 10 * number + 0.1 * robot, float(robot), float(number), 0.0, 40, 10.0, 10.0)


@pytest.mark.parametrize("source", ["/records/robot_1", START])
@pytest.mark.parametrize("doubt_first", [True, False])
@pytest.mark.parametrize(
    ("outcome", "doubted"),
    [
        (DoubtOutcome.OPEN, True),
        (DoubtOutcome.LOST, True),
        (DoubtOutcome.RETURNED, True),
        (DoubtOutcome.CONFIRMED, False),
    ],
)
def test_records_of_which_nobody_says_whose_they_are_are_doubted_with_any_robot(
    source, doubt_first, outcome, doubted
):
    """As those of the log of another robot's driver, and those of its own when it starts again."""
    records = MapRecords(FieldMap(GRID), TEAM_S)
    there = (1.0, 15.0) if outcome is DoubtOutcome.CONFIRMED else (7.0, 7.0)
    doubt = Doubt(1.78e9 + 100.0, 1.78e9 + 200.0, outcome, *there)
    if doubt_first:
        records.doubt(doubt, "/robot_2")
    records.take(source, [of_robot(1, number) for number in (0, 15)])
    records.doubt(doubt, "/robot_2")
    found = records.map.track
    assert [each.quarantine for each in found] == ["", "place_doubt" * doubted]
    assert [each.x_m for each in found] == [1.0, 1.0], "the place of another robot is not known"
