# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tests of a module that is missing are skipped on a laptop; in continuous integration they fail."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
COLLECT = """
import sys, pytest
sys.modules["matplotlib"] = None
sys.exit(pytest.main(["-p", "no:cacheprovider", "--collect-only", "test/reporting/test_paper_figures.py"]))
"""


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.parametrize(
    ("required", "code", "said"),
    [
        ("", pytest.ExitCode.NO_TESTS_COLLECTED, "SKIPPED"),
        ("1", pytest.ExitCode.INTERRUPTED, "ModuleNotFoundError"),
    ],
)
def test_a_missing_module(required, code, said):
    environment = {**os.environ, "MODULES_REQUIRED": required}
    command = [sys.executable, "-c", COLLECT]
    found = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert (found.returncode, said in found.stdout) == (code, True), found.stdout
