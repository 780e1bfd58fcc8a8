# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Finished missions of a campaign on disk: one small file each, written atomically."""

from __future__ import annotations

import fcntl
import hashlib
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, SoilmoistError, __version__
from soilmoist_ros.lab.campaign_file import CampaignMission
from soilmoist_ros.recording import write_whole
from soilmoist_ros.simulation import MapErrors, MissionResult, SeriesRow, series_columns

Array = NDArray[np.float64]
SCHEMA = 6
SUFFIX = ".npz"
COMPUTING = ("sensing", "mapping", "exploration", "simulation")  # sub-packages whose code determines a mission


class UnusableMissionError(SoilmoistError):
    """A stored mission that cannot be read, does not match its name, or is of another version of the code."""


@dataclass(frozen=True, eq=False)
class CampaignRun:
    """Stored content of a mission: how it went and ended. Its settings and seed make it, with its maps, again."""

    key: str  # digest of its settings
    version: str
    field_title: str  # name of the field for reports
    ended: str  # reason for the end
    columns: Mapping[str, Array]  # series from the start on, see :func:`series_columns`; each of shape (n,)


Stored = Sequence[tuple[CampaignMission, CampaignRun]]  # finished missions, in the order of the campaign


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
    names = ["", *(wanted.name for wanted in result.settings.properties)]
    start = SeriesRow(0.0, 0.0, 0, 0.0, (MapErrors(),) * len(names))
    columns = series_columns([start, *result.series], names)
    about = {
        "schema": SCHEMA, "key": key, "version": code_version(),
        "field_title": result.field_title or result.settings.field_name, "ended": result.ended,
        "columns": list(columns),
    }  # fmt: skip
    stream = io.BytesIO()
    np.savez_compressed(stream, about=np.array(json.dumps(about)), series=np.array([*columns.values()], float))
    return stream.getvalue()


def unpack(content: bytes) -> CampaignRun:
    """Read a mission from the bytes of its file; ``UnusableMissionError`` if the file is damaged or incomplete."""
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            about, series = json.loads(str(archive["about"])), archive["series"].astype(float)
        if about["schema"] != SCHEMA:
            raise ValueError(f"format {about['schema']}, not {SCHEMA}")
        return CampaignRun(
            about["key"], about["version"], about["field_title"], about["ended"],
            dict(zip(about["columns"], series, strict=True)),
        )  # fmt: skip
    except Exception as error:  # numpy, zipfile and tokenize have many errors for damaged bytes
        raise UnusableMissionError(f"cannot be read ({type(error).__name__}: {error})") from None


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

        :raises UnusableMissionError: if its file is damaged, contains another mission, or another version of the
            code computed it
        """
        path = self.path(mission.key)
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise UnusableMissionError(f"{path.name} cannot be read ({error.strerror})") from None
        try:
            return check(unpack(content), mission)
        except UnusableMissionError as error:
            raise UnusableMissionError(f"{path.name} {error}") from None

    def write(self, mission: CampaignMission, content: bytes) -> CampaignRun:
        """Store a mission atomically: an interruption never leaves an incomplete file.

        :raises UnusableMissionError: if the content belongs to another mission or version of the code
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
    """The stored mission, if it is the expected one of this version of the code; else ``UnusableMissionError``."""
    if stored.key != mission.key:
        raise UnusableMissionError("contains another mission than its name states")
    if stored.version != code_version():
        raise UnusableMissionError(f"was computed by version {stored.version}, this is {code_version()}")
    return stored
