# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The runs on this computer: what is known of each, its files, and long work: reports, exports and comparisons."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.console.board import Board
from soilmoist_ros.foundation import InputError, finite_number, read_json, read_limited
from soilmoist_ros.recording import SUMMARY
from soilmoist_ros.reporting import EXPORTS

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
_CLI: Final = ("-m", "soilmoist_ros.cli.main")
_SANDBOX: Final = "sandbox allow-scripts allow-downloads; default-src 'unsafe-inline' 'unsafe-eval' data: blob:"
"""Reports are read, but they are no part of the page: they cannot ask anything of the robots."""


def list_runs(folder: Path) -> list[dict[str, Any]]:
    """Runs in a folder, the latest first, as JSON; a folder with a summary or a recording is a run."""
    try:
        found = [path for path in folder.iterdir() if path.is_dir() and not path.is_symlink() and _is_run(path)]
    except OSError:
        return []
    found.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    return [_about(path) for path in found[:MAX_RUNS]]


def file_of(folder: Path, run: str, name: str) -> Path | None:
    """A file of a run that may be taken home; ``None`` for all else."""
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
    """Values from the summary of a run for a list; empty if no summary can be read."""
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


# What the page may do with the runs on this computer: list, read, have reports, exports, comparisons made -------


class RunRoutes:
    """Handlers of requests about runs."""

    def __init__(self, web: Any, folder: Path, jobs: Jobs) -> None:
        self._web, self._folder, self._jobs = web, folder, jobs

    def add(self, app: Any, operators: Callable[[Any], Any]) -> None:
        """Add the routes."""
        app.router.add_get("/runs", self._on_list)
        app.router.add_get("/runs/{run}/{name:.+}", self._on_file)
        app.router.add_post("/make", operators(self._on_make))

    async def _on_list(self, _request: Any) -> Any:
        runs = await asyncio.to_thread(list_runs, self._folder)
        return self._web.json_response({"folder": str(self._folder), "runs": runs, "formats": EXPORTS.names()})

    async def _on_file(self, request: Any) -> Any:
        path = file_of(self._folder, request.match_info["run"], request.match_info["name"])
        if path is None:
            raise self._web.HTTPNotFound
        headers = {"X-Content-Type-Options": "nosniff", "Content-Security-Policy": _SANDBOX}
        if path.name != REPORT:
            headers["Content-Disposition"] = f'attachment; filename="{_plain(path.name)}"'
        return self._web.FileResponse(path, headers=headers)

    async def _on_make(self, content: Any) -> dict[str, Any]:
        """Start a job: ``what`` is report, export or compare; ``runs`` are the names of runs."""
        what, names = content.get("what"), content.get("runs")
        if not isinstance(names, list) or not 1 <= len(names) <= 20:
            raise InputError("name the runs", "choose one")
        paths = [run_of(self._folder, str(name)) for name in names]
        if None in paths:
            raise InputError("there is no such run", "reload the page")
        runs = [str(path) for path in paths]
        if what == "report":
            name, arguments = f"report {names[0]}", ["replay", runs[0], "--out", runs[0]]
        elif what == "export":
            name, arguments = f"export {names[0]}", ["export", runs[0], *_formats(content.get("formats"))]
        elif what == "compare" and len(runs) > 1:
            target = self._folder / f"compared-{'-'.join(sorted(str(one) for one in names))}"[:120]
            name, arguments = "compare", ["season", *sorted(runs), "--out", str(target), "--overwrite"]
        else:
            raise InputError("this cannot be made", "choose report, export, or two runs to compare")
        refusal = self._jobs.start(name, [*_CLI, *arguments])
        return {"started": not refusal, "message": refusal or f"{name} is being made"}


def _formats(given: Any) -> list[str]:
    names = [str(one) for one in given] if isinstance(given, list) else []
    unknown = [name for name in names if name not in EXPORTS.names()]
    if unknown or not names:
        raise InputError("choose formats that soilmoist export knows", f"there are: {', '.join(EXPORTS.names())}")
    return [word for name in names for word in ("--to", name)]


def _plain(name: str) -> str:
    return "".join(letter if letter.isascii() and letter not in '"\\' else "_" for letter in name)


# Long work for the page, in processes of low priority, one after the other --------------------------------------

LIMIT_S: Final = 900.0
"""Longest time of one job [s]."""
MAX_WAITING: Final = 5
_YIELDING: Final = ("nice", "-n", "10")
"""The nodes come first."""
_END_S: Final = 5.0
"""Longest wait for what is ended [s]."""
_SAID: Final = 400
"""Last characters of the output that are shown when a job fails."""


class Jobs:
    """Runs Python modules in the server's thread; the section ``jobs`` says what became of each."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._one = asyncio.Lock()
        self._shown: dict[str, dict[str, str]] = {}
        self._tasks: set[asyncio.Task[Any]] = set()
        self._process: asyncio.subprocess.Process | None = None

    def start(self, name: str, arguments: Sequence[str]) -> str:
        """Start a job soon; why it is not, empty if it is."""
        if self._shown.get(name, {}).get("state") == "running":
            return f"{name} is being done already"
        if len(self._tasks) >= MAX_WAITING:
            return f"{MAX_WAITING} jobs wait already"
        self._show(name, "running", "")
        task = asyncio.get_running_loop().create_task(self._do(name, arguments))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return ""

    async def answer(self, arguments: Sequence[str], given: bytes, limit_s: float) -> tuple[int, bytes]:
        """Exit code and output of a module that reads its input; ``TimeoutError`` if it takes longer."""
        async with self._one:
            return await self._run(arguments, given, limit_s)

    async def close(self) -> None:
        """End what runs."""
        tasks = tuple(self._tasks)
        for task in tasks:
            task.cancel()
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
        if tasks:  # else the process would outlast the loop that hears of its end
            await asyncio.wait(tasks, timeout=_END_S)

    async def _do(self, name: str, arguments: Sequence[str]) -> None:
        try:
            async with self._one:
                code, said = await self._run(arguments, b"", LIMIT_S)
        except TimeoutError:
            self._show(name, "failed", f"not done after {LIMIT_S / 60:g} min")
        else:
            self._show(name, "done" if code == 0 else "failed", said.decode(errors="replace").strip()[-_SAID:])

    async def _run(self, arguments: Sequence[str], given: bytes, limit_s: float) -> tuple[int, bytes]:
        process = self._process = await asyncio.create_subprocess_exec(
            *_YIELDING, sys.executable, *arguments, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        try:
            said, _ = await asyncio.wait_for(process.communicate(given), limit_s)
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
        return process.returncode or 0, said

    def _show(self, name: str, state: str, text: str) -> None:
        self._shown = {**self._shown, name: {"state": state, "text": text}}
        self._board.put("jobs", self._shown)
