# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the page *Plan* asks for: forecasts, fields, walks, and what may be chosen for the next mission."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Mapping
from typing import Any, Final

from soilmoist_ros.console.jobs import Jobs
from soilmoist_ros.console.plan.survey_files import SurveyFiles
from soilmoist_ros.console.plan.walk import Walk
from soilmoist_ros.console.requests import who_of
from soilmoist_ros.foundation import InputError

WORK: Final = ("-m", "soilmoist_ros.console.plan.work")
LIMIT_S: Final = 180.0
"""Longest wait for a forecast [s]."""
SHORT_LIMIT_S: Final = 30.0
"""Longest wait for all else [s]."""


class PlanRoutes:
    """Handlers of requests of the page *Plan*.

    :param web: the module ``aiohttp.web``
    :param files: what may be chosen
    :param jobs: does what takes long
    :param walks: walks by the names of the robots
    """

    def __init__(self, web: Any, files: SurveyFiles, jobs: Jobs, walks: Mapping[str, Walk]) -> None:
        self._web, self._files, self._jobs, self._walks = web, files, jobs, walks

    def add(self, app: Any, operators: Callable[[Any], Any]) -> None:
        """Add the routes.

        :param app: the application
        :param operators: makes a handler that answers operators only
        """
        app.router.add_get("/files", self._on_files)
        for name, handler in (("plan", self._on_plan), ("field", self._on_field), ("walk", self._on_walk)):
            app.router.add_post(f"/{name}", operators(handler))

    async def _on_files(self, _request: Any) -> Any:
        return self._web.json_response(await asyncio.to_thread(self._files.listed))

    async def _on_plan(self, content: Any) -> Any:
        """Do a task of :mod:`.work`, in another process."""
        limit_s = LIMIT_S if content.get("task") == "forecast" else SHORT_LIMIT_S
        try:
            code, said = await self._jobs.answer(WORK, json.dumps(content).encode(), limit_s)
        except TimeoutError:
            raise InputError(
                f"not done after {limit_s:g} s", "plan a shorter mission, or a simpler field"
            ) from None
        if code:
            raise InputError("this cannot be made", "look at the log of the console")
        return json.loads(said.splitlines()[-1])

    async def _on_field(self, content: Any) -> Any:
        """Check and save a field; the answer has the name of its file."""
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
