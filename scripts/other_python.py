# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Run a script of this folder in the environment of another tool: JSON in, JSON out."""

from __future__ import annotations

import json
import subprocess
from typing import Any

from soilmoist_ros.foundation.errors import InputError


def run_in(python: str, script: str, problem: Any, tool: str, remedy: str) -> Any:
    """Answer of a script that reads JSON from its standard input, and writes JSON as its last line.

    :param python: interpreter of the environment
    :param script: path of the script
    :param problem: its input
    :param tool: name of the tool, for messages
    :param remedy: how the environment is made
    :raises InputError: if the tool cannot be run
    """
    try:
        done = subprocess.run([python, script], input=json.dumps(problem), capture_output=True, text=True)
    except OSError as error:
        raise InputError(f"{python} cannot be run: {error.strerror}", remedy) from None
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise InputError(f"{tool} failed in {python}: {reason}", remedy)
    return json.loads(done.stdout.splitlines()[-1])
