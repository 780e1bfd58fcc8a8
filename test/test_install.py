# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What installs: its progress (scripts/install), and that the help of a script installs nothing."""

import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

SCRIPT = Path(__file__).resolve().parent.parent / "scripts" / "install"


@pytest.fixture
def progress(load_script, monkeypatch):
    module = load_script("install")
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: 0.0))  # it takes no time
    one = module.Progress()
    yield one
    one.end()


def test_it_names_what_is_downloaded_and_counts_what_is_installed(progress, capsys):
    progress.read("Collecting numpy==2.1.0 (from -r requirements.txt (line 3))\n")
    progress.read("  Downloading numpy-2.1.0-cp311.whl (16 MB)\n")
    progress.read("Processing ./wheels/affine-3.0.1-py3-none-any.whl\n")
    assert progress._text() == "downloading, 2 packages so far: affine"
    progress.read("Installing collected packages: numpy, affine, click\n")
    assert progress._text() == "[" + 30 * "." + "] 0 of 3 packages installed"
    progress.end()
    assert "3 packages, 0 s" in capsys.readouterr().out


@pytest.mark.process
def test_messages_of_pip_are_shown_when_it_fails():
    command = [sys.executable, SCRIPT, "--no-index", "no-such-package==1"]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 1
    assert "No matching distribution found for no-such-package==1" in run.stderr
    assert "scripts/install: pip failed" in run.stderr


@pytest.mark.process
@pytest.mark.parametrize("name", ["demo", "test", "docs", "install", "build_interfaces", "keystore", "fuzz"])
def test_the_help_of_a_script_installs_nothing(name, tmp_path):
    shutil.copytree(SCRIPT.parent, tmp_path / "scripts")
    run = subprocess.run([tmp_path / "scripts" / name, "--help"], capture_output=True, text=True, cwd=tmp_path)
    assert (run.returncode, run.stderr) == (0, "")
    assert f"usage: {'.venv/bin/python ' * (name in ('install', 'fuzz'))}scripts/{name}" in run.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["scripts"]
