# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""An output folder before the work: whether it can be written, and which results a run would replace there."""

from __future__ import annotations

import logging
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from soilmoist_ros.foundation import InputError, install, is_installed, read_json
from soilmoist_ros.recording import SUMMARY, sync_file, sync_folder

PROJECT_NAME = "soilmoist.qgs"
NAMES = (SUMMARY, "map.tif", "samples.geojson", "report.html", "records.csv", PROJECT_NAME)
MISSION_NAMES = ("series.csv", "visits.csv")
CERTIFICATE_NAME = "certificate.json"
_NEEDS = {
    ".tif": ("pyproj", "rasterio"), ".qgs": ("pyproj", "rasterio", "jinja2"), ".html": ("jinja2", "matplotlib"),
}  # fmt: skip
"""Modules of the extra ``reports`` that write a file, by its ending."""
_LOG = logging.getLogger(__name__)
_WORKSHOP = ".writing-"
_LEFT_S = 3600.0
"""Age from which nobody writes such a folder any more [s]."""
_FURTHER = (
    "map_*.tif",
    "change.tif",
    "change_*.tif",
    "samples_*.geojson",
    "records_*.csv",
    "survey_*.tif",
    "moisture.csv",
)  # the last one is of earlier releases


def _results_in(folder: Path) -> str:
    """The results of a run in a folder, in words for the user; empty if there are none.

    :raises InputError: if the folder has files with the names of results that no run of this package wrote
    """
    names = _held(folder)
    if not names:
        return ""
    summary = _summary(folder)
    if summary is None:
        raise InputError(
            f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} not of a run of soilmoist",
            "choose another output folder: files of others are never replaced",
            folder,
        )
    kind = "a simulated run" if summary.get("simulated") else "a run"
    about = [str(summary[key]) for key in ("title", "field") if summary.get(key)]
    made = str(summary.get("created_utc", "")).replace("T", " ").replace("Z", " UTC")
    return f"the results of {kind} ({', '.join([*about, f'made {made}' if made else 'of unknown date'])})"


def require_free(folder: Path, overwrite: bool = False) -> None:
    """Check an output folder, which need not exist, before the work; files with other names do not matter.

    :param overwrite: whether results of an earlier run may be replaced
    :raises InputError: if the folder cannot be written, has results that must not be replaced, or has files of
        others with the names of results
    """
    home = folder.absolute()
    try:
        while not home.exists() and home != home.parent:
            home = home.parent
        if not stat.S_ISDIR(home.stat().st_mode):
            raise InputError("is a file, not a folder", "choose another output folder", home)
        if not os.access(home, os.W_OK | os.X_OK):
            raise InputError("must not be written", "choose another output folder", home)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another output folder", folder) from None
    if (held := _results_in(folder)) and not overwrite:
        remedy = "choose another output folder, or give --overwrite to replace them"
        raise InputError(f"has {held}", remedy, folder)


def writable(names: Sequence[str]) -> tuple[str, ...]:
    """The results that the installed extras can write; a warning names the others, and what to install."""
    absent = [name for name in names if not is_installed(*_NEEDS.get(Path(name).suffix, ()))]
    if absent:
        _LOG.warning("%s not written: %s", ", ".join(absent), install("reports"))
    return tuple(name for name in names if name not in absent)


@contextmanager
def replaced_together(folder: Path, names: Sequence[str], whole: bool = True) -> Iterator[Path]:
    """Replace the results in a folder together: write them to the hidden folder that the context gives.

    After an error the folder is as it was. What a killed process left is removed, and results of an earlier run
    that this run has not.

    :param names: files to replace, known when all are written
    :param whole: whether they are all results of a run; else results of an earlier run stay
    :raises InputError: if the folder cannot be written
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for left in folder.glob(f"{_WORKSHOP}*"):
            if time.time() - left.stat().st_mtime > _LEFT_S:
                shutil.rmtree(left, ignore_errors=True)
        workshop = Path(tempfile.mkdtemp(prefix=_WORKSHOP, dir=folder))
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another output folder", folder) from None
    try:
        yield workshop
        for name in names:
            sync_file(workshop / name)
        earlier = earlier_outputs(folder) if whole else set()
        for name in names:
            os.replace(workshop / name, folder / name)
        remove_earlier(folder, earlier, names)
        sync_folder(folder)
    finally:
        shutil.rmtree(workshop, ignore_errors=True)


def earlier_outputs(folder: Path) -> set[str]:
    """Names of the results that the summary in a folder lists; empty without a summary of this package."""
    listed = (_summary(folder) or {}).get("outputs", ())
    return set(_held(folder)) & {name for name in listed if isinstance(name, str)}


def remove_earlier(folder: Path, earlier: Iterable[str], kept: Iterable[str]) -> None:
    """Remove results of an earlier run, see :func:`earlier_outputs`, that a new run has not replaced."""
    for name in set(earlier) - set(kept):
        (folder / name).unlink(missing_ok=True)


def _held(folder: Path) -> list[str]:
    """Names of results in a folder, whoever wrote them."""
    patterns = (*NAMES, *MISSION_NAMES, CERTIFICATE_NAME, *_FURTHER)
    return [path.name for pattern in patterns for path in sorted(folder.glob(pattern))]


def _summary(folder: Path) -> dict[str, Any] | None:
    """The summary in a folder, ``None`` if there is none of this package."""
    try:
        content = read_json((folder / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    ours = isinstance(content, dict) and content.get("software") == "soilmoist_ros"
    return content if ours else None
