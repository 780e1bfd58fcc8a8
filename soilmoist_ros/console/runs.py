# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The runs on this computer: what is known of each, and the files that may be taken home."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.foundation import InputError, finite_number, read_json, read_limited
from soilmoist_ros.recording import SUMMARY

REPORT: Final = "report.html"
MAX_RUNS: Final = 200
MAX_FILES: Final = 200
_KINDS: Final = frozenset(
    {
        *(".html", ".tif", ".geojson", ".csv", ".json", ".yaml", ".kmz", ".kml", ".gpkg", ".zip", ".nc", ".mcap"),
        *(".qgz", ".qml", ".png", ".pdf"),
    }
)
_SKIPPED: Final = frozenset({"log", "journal"})


def list_runs(folder: Path) -> list[dict[str, Any]]:
    """Runs in a folder, the latest first, as JSON; a folder with a summary or a recording is a run."""
    try:
        found = [path for path in folder.iterdir() if path.is_dir() and not path.is_symlink() and _is_run(path)]
    except OSError:
        return []
    found.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    return [_about(path) for path in found[:MAX_RUNS]]


def file_of(folder: Path, run: str, name: str) -> Path | None:
    """A file of a run that may be taken home; ``None`` for all else.

    :param folder: folder of the runs
    :param run: name of the run
    :param name: path of the file in the run, with ``/``
    """
    home = run_of(folder, run)
    if home is None:
        return None
    path = (home / name).resolve()
    hidden = any(part.startswith(".") or part in _SKIPPED for part in Path(name).parts)
    allowed = path.is_relative_to(home) and path.suffix.lower() in _KINDS and not hidden
    return path if allowed and path.is_file() else None


def run_of(folder: Path, run: str) -> Path | None:
    """Folder of a run by its name; ``None`` if there is no such run."""
    path = (folder / run).resolve()
    if path.parent != folder.resolve() or path.name != run or not path.is_dir() or not _is_run(path):
        return None
    return path


def _is_run(path: Path) -> bool:
    return (path / SUMMARY).is_file() or (path / "metadata.yaml").is_file() or (path / "bag").is_dir()


def _about(path: Path) -> dict[str, Any]:
    files = []
    for file in sorted(path.rglob("*")):
        inside = file.relative_to(path)
        if file_of(path.parent, path.name, inside.as_posix()) is not None:
            files.append([inside.as_posix(), file.stat().st_size])
    summary = _summary(path)
    return {
        "name": path.name,
        "changed": datetime.fromtimestamp(path.stat().st_mtime, UTC).isoformat(timespec="minutes"),
        "files": files[:MAX_FILES],
        "report": (path / REPORT).is_file(),
        "recording": (path / "bag").is_dir() or (path / "metadata.yaml").is_file(),
        "finished": any((path / name).is_file() for name in (SUMMARY, "metadata.yaml", "bag/metadata.yaml")),
        **summary,
    }


def _summary(path: Path) -> dict[str, Any]:
    """What the summary of a run says for a list; nothing if there is none that can be read."""
    try:
        content = read_json(read_limited(path / SUMMARY).decode("utf-8"))
        stops = (content.get("mission") or {}).get("stops")
        moisture = ((content.get("map") or {}).get("vwc") or {}) if isinstance(content.get("map"), dict) else {}
        return {
            "field": str(content.get("field") or content.get("title") or ""),
            "start": str(content.get("survey_start_utc") or ""),
            "duration_s": finite_number(content.get("survey_duration_s")),
            "distance_m": finite_number(content.get("distance_m")),
            "stops": finite_number(stops),
            "simulated": bool(content.get("simulated")),
            "vwc": finite_number(moisture.get("mean")),
        }
    except (InputError, ValueError, AttributeError):
        return {}
