# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Routes of the page *Plan*: fields, walks, and the files that may be chosen."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.console.plan_work import Walk
from soilmoist_ros.console.runs import Jobs, run_of
from soilmoist_ros.console.visitors import who_of
from soilmoist_ros.exploration import OperatorRequest
from soilmoist_ros.foundation import InputError

WORK: Final = ("-m", "soilmoist_ros.console.plan_work")
LIMIT_S: Final = 30.0
"""Longest wait for an answer [s]."""
START: Final = "(start)"
"""Name of the field with which the nodes were started."""
MAX_FIELDS: Final = 500
_SUFFIX: Final = ".yaml"


class PlanRoutes:
    """Handlers of requests of the page *Plan*."""

    def __init__(self, web: Any, files: SurveyFiles, jobs: Jobs, walks: Mapping[str, Walk]) -> None:
        self._web, self._files, self._jobs, self._walks = web, files, jobs, walks

    def add(self, app: Any, operators: Callable[[Any], Any]) -> None:
        """Add the routes."""
        app.router.add_get("/files", self._on_files)
        for name, handler in (("plan", self._on_plan), ("field", self._on_field), ("walk", self._on_walk)):
            app.router.add_post(f"/{name}", operators(handler))

    async def _on_files(self, _request: Any) -> Any:
        return self._web.json_response(await asyncio.to_thread(self._files.listed))

    async def _on_plan(self, content: Any) -> Any:
        try:
            code, said = await self._jobs.answer(WORK, json.dumps(content).encode(), LIMIT_S)
        except TimeoutError:
            raise InputError(f"not done after {LIMIT_S:g} s", "draw a simpler field") from None
        if code:
            raise InputError("this cannot be made", "look at the log of the console")
        return json.loads(said.splitlines()[-1])

    async def _on_field(self, content: Any) -> Any:
        answer = await self._on_plan({**content, "task": "field"})
        if "error" in answer:
            return answer
        name = str(content.get("name") or "drawn field")[:60]
        file = await asyncio.to_thread(self._files.save, name, answer["file"], who_of(content))
        return {"file": file, "area_m2": answer["area_m2"]}

    async def _on_walk(self, content: Any) -> dict[str, Any]:
        """Begin or end the record of a walk; at its end the answer has its places."""
        walk = self._walks.get(str(content.get("robot", "")))
        if walk is None:
            raise InputError("there is no such robot", "reload the page")
        if content.get("do") == "begin":
            walk.begin(who_of(content), "area" if content.get("kind") == "area" else "boundary")
            return {}
        return walk.end()


# Files on this computer that a page may choose for the next mission, by their names: fields and runs ------------


@dataclass(frozen=True)
class SurveyFiles:
    """Folders of the files to choose from: fields (drawn ones are saved there), runs; initial field."""

    fields: Path
    runs: Path
    start: Path | None = None

    def listed(self) -> dict[str, Any]:
        """Names of the fields, the latest first."""
        fields = sorted(_files(self.fields), key=lambda path: path.stat().st_mtime, reverse=True)
        return {"fields": [path.name for path in fields[:MAX_FIELDS]]}

    def save(self, name: str, text: str, who: str) -> str:
        """Save a field; nothing is overwritten."""
        stem = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:40] or "field"
        now = datetime.now(UTC)
        if len(_files(self.fields)) >= MAX_FIELDS:
            raise InputError(f"there are {MAX_FIELDS} fields already", f"remove files from {self.fields}")
        file = f"{stem}-{now:%Y%m%d-%H%M%S-%f}{_SUFFIX}"
        try:
            self.fields.mkdir(parents=True, exist_ok=True)
            said = f"# Drawn on the operator's page by {who or 'the operator'}, {now:%Y-%m-%d %H:%M} UTC.\n"
            (self.fields / file).write_text(said + text, encoding="utf-8")
        except OSError as error:
            raise InputError(f"the field cannot be saved: {error.strerror}", "make space on the disk") from None
        return file

    def resolved(self, request: OperatorRequest) -> OperatorRequest:
        """A request with the paths of the names in it; a page cannot name other files of this computer."""
        changes: dict[str, Any] = {}
        if request.field:
            changes["field"] = str(self._field(request.field))
        if request.earlier is not None:
            changes["earlier"] = tuple(str(self._run(name)) for name in request.earlier)
        return replace(request, **changes) if changes else request

    def _field(self, name: str) -> Path:
        if name == START and self.start is not None:
            return self.start.absolute()
        known = {path.name: path for path in _files(self.fields)}
        if name not in known:
            raise InputError(f"there is no field {name!r:.60}", "reload the list")
        return known[name]

    def _run(self, name: str) -> Path:
        path = run_of(self.runs, name)
        if path is None:
            raise InputError(f"there is no run {name!r:.60}", "reload the list")
        return path


def _files(folder: Path) -> list[Path]:
    try:
        return sorted(path.absolute() for path in folder.iterdir() if path.suffix.lower() == _SUFFIX)
    except OSError:
        return []
