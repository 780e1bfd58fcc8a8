# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where recorded places lie in the field that is mapped: a recording may have the datum of another field file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.exploration import Visit
from soilmoist_ros.foundation import InputError, LocalFrame, Mistake, resource
from soilmoist_ros.mapping import Field, PositionSource, load_field, require_near
from soilmoist_ros.pipeline.bag_lines import fix_topic, read_fixes, unread_positions
from soilmoist_ros.pipeline.topics import TEXT
from soilmoist_ros.recording import BagReader, read_parameters
from soilmoist_ros.reporting import FieldSurvey
from soilmoist_ros.sensing import DOUBTS, CountRecord, Doubt, Doubts, Heard


@dataclass(frozen=True)
class RecordedPlaces:
    """The plane of a recording, and the field to which its places are converted.

    :param recorded: plane of the recorded places
    :param field: the field that is mapped
    """

    recorded: LocalFrame
    field: Field

    def latlon(self, xy_m: ArrayLike) -> NDArray[np.float64]:
        """Latitude and longitude of recorded places, shape (n, 2) [deg]."""
        return self.recorded.to_geographic(np.asarray(xy_m, float).reshape(-1, 2))

    def records(self, records: Sequence[CountRecord]) -> list[CountRecord]:
        """Records with their places in the plane of the field.

        :raises InputError: if all lie on the other side of the earth
        """
        if self.recorded == self.field.frame or not records:
            return list(records)
        recorded = [(record.x_m, record.y_m) for record in records]
        xy = self._to_field(recorded)
        if np.isfinite(recorded).all(axis=1).any() and not np.isfinite(xy).any():
            require_near(self.field, self.latlon(recorded), 0.0, PositionSource("the recording"))
        return [replace(record, x_m=x, y_m=y) for record, (x, y) in zip(records, xy, strict=True)]

    def doubts(self, reader: BagReader, counts: str) -> Doubts:
        """Doubts of the planner of a robot about its place; empty if the bag has none.

        :param counts: full name of a topic with records of the robot
        """
        doubts, above = Doubts(), counts
        while above:
            above = above.rpartition("/")[0]
            if reader.topics.get(f"{above}/{DOUBTS}") == TEXT:
                for text in reader.read_texts(f"{above}/{DOUBTS}"):
                    with suppress(ValueError):
                        doubt = Doubt.from_text(text)
                        for x, y in (("x_m", "y_m"), ("before_x_m", "before_y_m")):
                            place = getattr(doubt, x), getattr(doubt, y)
                            if self.recorded != self.field.frame and math.isfinite(place[0]):
                                [(x_m, y_m)] = self._to_field([place])
                                moved: dict[str, Any] = {x: x_m, y: y_m}
                                doubt = replace(doubt, **moved)
                        doubts.take(doubt)
                break
        return doubts

    def trusted_records(self, reader: BagReader, counts: Sequence[str], frame: str) -> list[CountRecord]:
        """Records of topics in the plane of the field, as far as their places are trusted."""
        doubts = {name: self.doubts(reader, name) for name in counts}
        found = reader.read_counts_of(counts, frame)
        moved = self.records([record for _, record in found])
        return [doubts[name].placed(record) for (name, _), record in zip(found, moved, strict=True)]

    def visits(self, visits: Sequence[Visit]) -> list[Visit]:
        """Visits with their places in the plane of the field."""
        if self.recorded == self.field.frame or not visits:
            return list(visits)
        stood = self._to_field([(visit.x_m, visit.y_m) for visit in visits])
        planned = self._to_field([(visit.stop_x_m, visit.stop_y_m) for visit in visits])
        return [
            replace(visit, x_m=x, y_m=y, stop_x_m=stop_x, stop_y_m=stop_y)
            for visit, (x, y), (stop_x, stop_y) in zip(visits, stood, planned, strict=True)
        ]

    def _to_field(self, xy_m: ArrayLike) -> list[list[float]]:
        """Places in the plane of the field [m]; NaN stays NaN."""
        xy = np.asarray(xy_m, float)
        known = np.isfinite(xy).all(axis=1)
        moved = np.full_like(xy, np.nan)
        moved[known] = self.field.frame.to_local(*self.latlon(xy[known]).T)
        return [[float(x), float(y)] for x, y in moved]


def recorded_places(configuration: Path | None, field: Field) -> RecordedPlaces:
    """The plane of a recording, by the field file of its driver; that of the field if it is unknown.

    :param configuration: folder with the parameters of the nodes, if any
    :param field: the field that is mapped
    """
    for node in ("sensor_driver", "mapper"):
        named: Mapping[str, Any] = read_parameters(configuration, node)
        if named.get("field"):
            try:
                return RecordedPlaces(load_field(resource("fields", str(named["field"]))).frame, field)
            except InputError:
                continue
    return RecordedPlaces(field.frame, field)


def _why_unplaced(records: Sequence[CountRecord], path: Path) -> Mistake | None:
    """Why no record of a recording has a place, from its positions; ``None`` if these do not say."""
    heard = Heard()
    try:
        with BagReader(path) as reader:
            if (topic := fix_topic(reader)) is None:
                unread = unread_positions(reader)
                return unread[0].mistake if unread else None
            for fix in read_fixes(reader, topic)[0]:
                heard.add(fix)
    except InputError:
        return None  # of several robots, or damaged
    stamps = [record.stamp_s for record in records]
    return heard.why_not_at(min(stamps), max(stamps)) if stamps else heard.why_none()


def why_nothing(survey: FieldSurvey, records: Sequence[CountRecord], path: Path) -> InputError:
    """Why none of the records is in the map: they lie elsewhere, or have other faults.

    :param survey: field and map of the records
    :param records: all records, in the plane of the field
    :param path: the recording
    """
    places = [(record.x_m, record.y_m) for record in records if np.isfinite(record.x_m + record.y_m)]
    field = survey.field
    if not places and (why := _why_unplaced(records, path)) is not None:
        return InputError([why])
    if places:
        try:
            source = PositionSource("the recording", field_file=dict(survey.files).get("field"))
            require_near(field, field.frame.to_geographic(places), survey.map.settings.margin_m, source)
        except InputError as error:
            return error
    reasons = [
        f"{entry.count} {reason.value} (the last: {entry.example})" for reason, entry in survey.map.skipped.items()
    ]
    message = f"not one of {len(records)} records is in the field {field.name!r}: {'; '.join(reasons)}"
    return InputError(message, "check the field file and the GNSS", path)
