"""The files of a rehearsal, written by the real journal and the real logs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from soilmoist_ros.exploration.mission.journal import EVENT
from soilmoist_ros.mapping.field_map import FieldMap
from soilmoist_ros.recording.journal import Journal, load_journal
from soilmoist_ros.recording.map_records import MapRecords
from soilmoist_ros.recording.map_sources import MapSources, open_session
from soilmoist_ros.recording.record_log import DRIVER, RecordLog
from soilmoist_ros.sensing.records import CountRecord

FRAME = "map"


class Disk:
    """The files of a rehearsal: journal of the mission, logs of driver and mapper.

    :param folder: where
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._session = open_session(folder / "records", folder / "journal", fresh=True)
        self._driver = RecordLog(self._session / DRIVER, FRAME)
        self._journal: Journal | None = None

    def open_journal(self) -> tuple[Journal, str | None, Iterable[Mapping[str, Any]]]:
        """See ``Store``."""
        found = load_journal(self._folder / "journal")
        self._journal = Journal.open(self._folder / "journal")
        return self._journal, found.snapshot, [entry.payload for entry in found.entries if entry.kind == EVENT]

    def close_journal(self) -> None:
        """See ``Store``."""
        if self._journal is not None:
            self._journal.close()

    def publish(self, record: CountRecord) -> None:
        """See ``Store``."""
        self._driver.write([record])

    def close(self) -> None:
        """Release the driver's log."""
        self._driver.close()

    def open_map(self, field_map: FieldMap) -> Sources:
        """See ``Store``."""
        return Sources(field_map, self._session, self._folder / "journal")


class Sources:
    """The sources of a mapper's map.

    :param field_map: the map
    :param session: folder of the logs
    :param journal: folder of the planner's journal
    """

    def __init__(self, field_map: FieldMap, session: Path, journal: Path) -> None:
        self._sources = MapSources(MapRecords(field_map), session, [journal], ["/counts"], frame=FRAME)

    def received(self, records: Sequence[CountRecord]) -> None:
        """See ``MapStore``."""
        self._sources.received(records)

    def second(self, age_s: float) -> None:
        """See ``MapStore``."""
        self._sources.poll()
        self._sources.merge(self._sources.missed(age_s))

    def close(self) -> None:
        """See ``MapStore``."""
        self._sources.close()
