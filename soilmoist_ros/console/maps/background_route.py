# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Has the background made in another process, and serves it."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import logging
from typing import Any, Final

from soilmoist_ros.console.board import Board
from soilmoist_ros.console.jobs import Jobs

LIMIT_S: Final = 300.0
"""Longest time that a background may take [s]."""
_log = logging.getLogger(__name__)


class BackgroundRoute:
    """Handler of requests for the background.

    :param web: the module ``aiohttp.web``
    :param source: GeoTIFF or folder of tiles; empty for none
    :param board: has the section ``field``; receives ``background``: extent and version, or an error
    :param jobs: does what takes long
    """

    def __init__(self, web: Any, source: str, board: Board, jobs: Jobs) -> None:
        self._web, self._source, self._board, self._jobs = web, source, board, jobs
        self._jpeg: bytes | None = None
        self._making: asyncio.Task[None] | None = None

    def add(self, app: Any) -> None:
        """Add the route, and make the background as soon as the application starts."""
        app.on_startup.append(self._start)
        app.on_cleanup.append(self._end)
        app.router.add_get("/background.jpg", self._on_picture)

    async def _start(self, _app: Any) -> None:
        if self._source:
            self._making = asyncio.create_task(self._make())

    async def _end(self, _app: Any) -> None:
        if self._making is not None:
            self._making.cancel()

    async def _make(self) -> None:
        field = self._board.get("field")
        asked = {"source": self._source, "datum": field["datum"], "boundary": field["boundary"]}
        given = json.dumps(asked).encode()
        try:
            _, said = await self._jobs.answer(("-m", "soilmoist_ros.console.maps.background"), given, LIMIT_S)
            answer = json.loads(said.splitlines()[-1])
        except (TimeoutError, ValueError, IndexError):
            answer = {"error": f"{self._source} cannot be made a background"}
        if error := answer.get("error"):
            _log.error("no background: %s", error)
            self._board.put("background", {"error": error})
            return
        self._jpeg = base64.b64decode(answer["jpeg"])
        version = hashlib.sha256(self._jpeg).hexdigest()[:12]
        self._board.put("background", {"extent": answer["extent"], "version": version})

    async def _on_picture(self, _request: Any) -> Any:
        if self._jpeg is None:
            raise self._web.HTTPNotFound
        headers = {"Cache-Control": "private, max-age=86400"}  # the page asks for it by its version
        return self._web.Response(body=self._jpeg, content_type="image/jpeg", headers=headers)
