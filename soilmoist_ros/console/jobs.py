# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Long work for the page, in processes of low priority, one after the other."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Sequence
from typing import Any, Final

from soilmoist_ros.console.board import Board

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
    """Runs Python modules in the server's thread; the section ``jobs`` says what became of each.

    :param board: shows the jobs
    """

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
        """Run a module that reads its input and prints its answer.

        :returns: exit code and output
        :raises TimeoutError: if it takes longer
        """
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
            *_YIELDING,
            sys.executable,
            *arguments,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )
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
