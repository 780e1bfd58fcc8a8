# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the page may do with the runs on this computer: list, read, have reports, exports, comparisons made."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.console.jobs import Jobs
from soilmoist_ros.console.runs import REPORT, file_of, list_runs, run_of
from soilmoist_ros.foundation import InputError
from soilmoist_ros.reporting import EXPORTS

_CLI: Final = ("-m", "soilmoist_ros.cli.main")
_SANDBOX: Final = "sandbox allow-scripts allow-downloads; default-src 'unsafe-inline' 'unsafe-eval' data: blob:"
"""Reports are read, but they are no part of the page: they cannot ask anything of the robots."""


class RunRoutes:
    """Handlers of requests about runs.

    :param web: the module ``aiohttp.web``
    :param folder: folder of the runs
    :param jobs: does what takes long
    """

    def __init__(self, web: Any, folder: Path, jobs: Jobs) -> None:
        self._web, self._folder, self._jobs = web, folder, jobs

    def add(self, app: Any, operators: Callable[[Any], Any]) -> None:
        """Add the routes.

        :param app: the application
        :param operators: makes a handler that answers operators only
        """
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
