# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The files of a rehearsal, written by the real journal and the real logs."""

from __future__ import annotations

import contextlib
import errno
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from soilmoist_ros.exploration.mission.journal import EVENT
from soilmoist_ros.mapping.field_map import FieldMap
from soilmoist_ros.recording import journal as journal_files
from soilmoist_ros.recording.bag.metadata import Definition, Topic
from soilmoist_ros.recording.bag.recorder import BagRecorder, next_bag
from soilmoist_ros.recording.journal import Journal, load_journal
from soilmoist_ros.recording.map_records import MapRecords
from soilmoist_ros.recording.map_sources import DRIVER, MapSources, RecordLog, RecordTail, open_session
from soilmoist_ros.recording.stored_records import stored_counts
from soilmoist_ros.sensing import CountRecord, Doubt

FRAME = "map"
CLOUD, FIELD = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/PointField"
STORE = get_typestore(Stores.ROS2_JAZZY)
COUNTS = Topic("/counts", Definition(CLOUD, STORE.generate_msgdef(CLOUD, ros_version=2)[0]))
POINT = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "z")),
        ("raw_counts", "<u4"),
        *((name, "<f8") for name in ("exposure_s", "effective_exposure_s", "corrected_rate")),
        *((name, "<f8") for name in ("f_pressure", "f_humidity", "f_intensity", "stamp_offset_s")),
    ]
)
"""A point of ``counts``, as the driver publishes it."""
DATATYPES = {"<f4": 7, "<u4": 6, "<f8": 8}
_FILES = {name: getattr(journal_files, name) for name in ("_write", "write_whole")}


def counts_message(record: CountRecord, frame: str) -> bytes:
    types, whole_s = STORE.types, math.floor(record.stamp_s)
    row = (record.x_m, record.y_m, record.z_m, record.raw_counts, record.exposure_s, record.effective_exposure_s)
    table = np.array([(*row, record.corrected_rate, 1.0, 1.0, 1.0, record.stamp_s - whole_s)], POINT)
    assert POINT.fields is not None
    fields = [types[FIELD](name, offset, DATATYPES[kind.str], 1) for name, (kind, offset) in POINT.fields.items()]
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](whole_s, 0), frame)
    data = np.frombuffer(table.tobytes(), "u1")
    cloud = types[CLOUD](header, 1, 1, fields, False, POINT.itemsize, POINT.itemsize, data, True)
    return bytes(STORE.serialize_cdr(cloud, CLOUD))


def _refuse(*_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


class Disk:
    """The files of a rehearsal: journal of the mission, logs of driver and mapper."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._session = open_session(folder / "records", folder / "journal", fresh=True)
        self._driver = RecordLog(self._session / DRIVER, FRAME)
        self._journal: Journal | None = None
        self._recorder = BagRecorder(lambda: next_bag(folder / "bags", "rehearsal", "jazzy"))
        self._recorder.start()

    def open_journal(self) -> tuple[Journal, str | None, Iterable[Mapping[str, Any]], bool]:
        found = load_journal(self._folder / "journal")
        self._journal = Journal.open(self._folder / "journal")
        events = [entry.payload for entry in found.entries if entry.kind == EVENT]
        return self._journal, found.snapshot, events, found.complete

    def close_journal(self) -> None:
        if self._journal is not None:
            self._journal.close()

    def publish(self, records: Sequence[CountRecord]) -> None:
        with contextlib.suppress(OSError):  # the driver publishes them nevertheless
            self._driver.write(records)
        for record in records:
            stamp_ns = round(1e9 * record.stamp_s)
            self._recorder.put(COUNTS, stamp_ns, stamp_ns, counts_message(record, FRAME))

    def full(self, is_full: bool) -> None:
        """See ``Store``. The bag is on another disk."""
        for name in ("_write", "write_whole"):
            setattr(journal_files, name, _refuse if is_full else _FILES[name])
        if not is_full and self._driver.waits:
            self._driver.write([])

    def stored(self) -> Mapping[str, Sequence[CountRecord]]:
        state = self._recorder.stop()
        bag = [] if state.bag is None else stored_counts(state.bag, [COUNTS.name], FRAME)
        return {"the driver's log": RecordTail(self._session / DRIVER, FRAME).read().records, "the bag": bag}

    def close(self) -> None:
        """Release the driver's log and the bag."""
        self.full(False)
        self._recorder.stop()
        self._driver.close()

    def open_map(self, field_map: FieldMap) -> Sources:
        return Sources(field_map, self._session)


class Sources:
    """The sources of a mapper's map."""

    def __init__(self, field_map: FieldMap, session: Path) -> None:
        self._records = MapRecords(field_map)
        self._sources = MapSources(self._records, session, FRAME)

    def doubt(self, doubt: Doubt) -> None:
        self._records.doubt(doubt)

    def received(self, records: Sequence[CountRecord]) -> None:
        self._sources.received(records)

    def second(self, age_s: float) -> None:
        self._sources.poll()

    def close(self) -> None:
        self._sources.close()
