# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Finished missions of a campaign on disk: one small file each, written atomically."""

from __future__ import annotations

import fcntl
import hashlib
import io
import json
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import Visit, VisitEnd
from soilmoist_ros.foundation import InputError, SoilmoistError, __version__
from soilmoist_ros.lab.campaign_file import CampaignMission
from soilmoist_ros.recording import write_whole
from soilmoist_ros.simulation import (
    MapErrors,
    MissionResult,
    MissionSettings,
    PropertySettings,
    SeriesRow,
    mission_efficiency,
)

Array = NDArray[np.float64]
SCHEMA = 4
SUFFIX = ".npz"
COMPUTING = ("sensing", "mapping", "exploration", "simulation")  # sub-packages whose code determines a mission


class DamagedMissionError(SoilmoistError):
    """A stored mission that cannot be read, or whose content does not match its name."""


class StaleMissionError(DamagedMissionError):
    """A stored mission from another version of the code."""


@dataclass(frozen=True, eq=False)
class CampaignRun:
    """Stored content of a mission; maps have single precision and are NaN outside the field."""

    settings: MissionSettings
    key: str
    version: str
    field_title: str  # name of the field for reports
    ended: str
    efficiency: float  # efficiency of its plan, see :class:`Efficiency`; NaN if it has none
    series: tuple[SeriesRow, ...]
    visits: tuple[Visit, ...]
    tracks: tuple[Array, ...]  # corner points of each robot's path, shape (p, 2) [m]
    x_m: Array  # centres of the map's columns, shape (nx,) [m]; this and all later arrays are empty without a map
    y_m: Array
    rate: Array  # final map of the rate, shape (ny, nx) [counts/s]
    rate_sd: Array
    truth_rate: Array
    outlines: tuple[Array, ...]  # boundaries of the field, each of shape (k, 2) [m]


@cache
def code_version() -> str:
    """Version of the package with a digest of the computing code, which separates results of different code."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for path in sorted(path for name in COMPUTING for path in (package / name).glob("**/*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return f"{__version__}+{digest.hexdigest()[:12]}"


def pack(result: MissionResult, key: str) -> bytes:
    """Serialise a finished mission."""
    soil_map, plan = result.soil_map, mission_efficiency(result)
    about = {
        "schema": SCHEMA, "key": key, "version": code_version(), "settings": result.settings.as_dict(),
        "field_title": result.field_title, "ended": result.ended,
        "efficiency": None if plan is None else plan.reached, "visits": [asdict(visit) for visit in result.visits],
    }  # fmt: skip
    empty: Array = np.empty(0)
    shown: Sequence[Array] = (
        (empty, empty, empty, empty, empty)
        if soil_map is None
        else (soil_map.grid.x_m, soil_map.grid.y_m, soil_map.rate, soil_map.rate_sd, result.truth_rate)
    )
    x_m, y_m, rate, rate_sd, truth = shown
    rings = [] if soil_map is None else [*soil_map.grid.polygons, *soil_map.grid.holes]
    stream = io.BytesIO()
    np.savez_compressed(
        stream, about=np.array(json.dumps(about)), series=_packed_series(result),
        tracks=np.concatenate([np.empty((0, 2)), *result.tracks]),
        track_lengths=np.array([len(track) for track in result.tracks], int), x_m=x_m, y_m=y_m,
        rate=np.asarray(rate, np.float32), rate_sd=np.asarray(rate_sd, np.float32),
        truth_rate=np.asarray(truth, np.float32), rings=np.concatenate([np.empty((0, 2)), *rings]),
        ring_lengths=np.array([len(ring) for ring in rings], int),
    )  # fmt: skip
    return stream.getvalue()


def unpack(content: bytes) -> CampaignRun:
    """Read a mission from the bytes of its file; ``DamagedMissionError`` if the file is damaged or incomplete."""
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        about = json.loads(str(arrays["about"]))
        if about["schema"] != SCHEMA:
            raise StaleMissionError(f"has format {about['schema']}, not {SCHEMA}")
        visits = tuple(Visit(**{**visit, "ended": VisitEnd(visit["ended"])}) for visit in about["visits"])
        return CampaignRun(
            settings=_settings(about["settings"]), key=about["key"], version=about["version"],
            field_title=about["field_title"], ended=about["ended"],
            efficiency=math.nan if about.get("efficiency") is None else float(about["efficiency"]),
            series=tuple(map(_row, arrays["series"].astype(float).tolist())), visits=visits,
            tracks=_pieces(arrays["tracks"], arrays["track_lengths"]),
            outlines=_pieces(arrays["rings"], arrays["ring_lengths"]),
            **{name: np.asarray(arrays[name], float) for name in ("x_m", "y_m", "rate", "rate_sd", "truth_rate")},
        )  # fmt: skip
    except StaleMissionError:
        raise
    except Exception as error:  # numpy, zipfile and tokenize have many errors for damaged bytes
        raise DamagedMissionError(f"cannot be read ({type(error).__name__}: {error})") from None


def _settings(values: dict[str, Any]) -> MissionSettings:
    properties = tuple(PropertySettings(**one) for one in values["properties"])
    earlier = {"noise": "mean", "local": "off", "drift_model": "off"}  # in files without these keys
    return MissionSettings(**{**earlier, **values, "properties": properties})


_STATE = ("time_s", "distance_m", "samples", "counting_s")


def _packed_series(result: MissionResult) -> Array:
    """Series as a table of numbers: the state, then the errors of each property."""
    width = len(_STATE) + len(MapErrors._fields) * len(result.properties)
    rows = [[*(getattr(row, name) for name in _STATE), *chain.from_iterable(row.errors)] for row in result.series]
    return np.array(rows, float).reshape(-1, width)


def _row(values: list[float]) -> SeriesRow:
    """A series entry from a row of numbers."""
    time_s, distance_m, samples, counting_s, *errors = values
    size = len(MapErrors._fields)
    found = tuple(MapErrors(*errors[start : start + size]) for start in range(0, len(errors), size))
    return SeriesRow(time_s, distance_m, int(samples), counting_s, found)


def _pieces(joined: Array, lengths: NDArray[np.int_]) -> tuple[Array, ...]:
    """Split concatenated arrays by their lengths."""
    return tuple(np.split(joined, np.cumsum(lengths)[:-1])) if len(lengths) else ()


class MissionStore:
    """The folder of finished missions.

    :raises InputError: if it cannot be created
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"cannot be written: {error.strerror}", "choose another output folder", folder
            ) from None

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other campaigns from writing here (``InputError``), and remove what a killed one left."""
        with (self.folder / ".lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                message = "another campaign is writing in this folder"
                raise InputError(
                    message, "wait for it or stop it, or choose another folder", self.folder
                ) from None
            for path in (*self.folder.glob(".*.writing"), *self.folder.glob(f"*{SUFFIX}.tmp")):
                path.unlink(missing_ok=True)
            yield

    def path(self, key: str) -> Path:
        """File of a mission."""
        return self.folder / f"{key}{SUFFIX}"

    def read(self, mission: CampaignMission) -> CampaignRun | None:
        """A finished mission, ``None`` if there is none.

        :raises DamagedMissionError: if its file is damaged or contains another mission
        :raises StaleMissionError: if another version of the code computed it
        """
        path = self.path(mission.key)
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise DamagedMissionError(f"{path.name} cannot be read ({error.strerror})") from None
        try:
            return check(unpack(content), mission)
        except DamagedMissionError as error:
            raise type(error)(f"{path.name} {error}") from None

    def write(self, mission: CampaignMission, content: bytes) -> CampaignRun:
        """Store a mission atomically: an interruption never leaves an incomplete file.

        :raises DamagedMissionError: if the content belongs to another mission or version of the code
        :raises InputError: if it cannot be written
        """
        stored = check(unpack(content), mission)
        try:
            write_whole(self.path(mission.key), content)
        except OSError as error:
            raise InputError(
                f"a mission cannot be stored: {error.strerror}",
                "free disk space or choose another output folder; stored missions are reused",
                self.folder,
            ) from None
        return stored


def check(stored: CampaignRun, mission: CampaignMission) -> CampaignRun:
    """The stored mission, if it is the expected one of this version of the code; else ``DamagedMissionError``."""
    if stored.key != mission.key:
        raise DamagedMissionError("contains another mission than its name states")
    if stored.version != code_version():
        raise StaleMissionError(f"was computed by version {stored.version}, this is {code_version()}")
    return stored
