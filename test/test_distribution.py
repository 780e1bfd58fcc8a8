# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The source distribution and the wheel, in a clean environment with the light core only."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
pytestmark = [pytest.mark.slow, pytest.mark.process]

MAX_INSTALLED_BYTES = 250e6
"""Without what Python compiles later."""
HEAVY = {"aiohttp", "jinja2", "matplotlib", "mcap", "pandas", "pyproj", "pyvrp", "rasterio"}
REMEDY = "pip install 'soilmoist_ros[reports]'"


def run(*command, cwd, code=0):
    """Run a command in an environment that knows nothing of this one; return what it prints."""
    environment = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PYTHON", "_ROS", "AMENT")) and name not in ("LD_LIBRARY_PATH", "VIRTUAL_ENV")
    }
    done = subprocess.run(list(map(str, command)), cwd=cwd, env=environment, capture_output=True, text=True)
    assert done.returncode == code, done.stdout + done.stderr
    return done


def installed_bytes(folder):
    return sum(path.lstat().st_blocks * 512 for path in folder.rglob("*"))


@pytest.fixture(scope="module")
def built(tmp_path_factory, load_script):
    """The source distribution of the tracked files, and the wheel that is made from it."""
    home = tmp_path_factory.mktemp("built")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    tracked = [name for name in listed.split("\0") if name and (ROOT / name).is_file()]
    for name in tracked:
        (home / "clone" / name).parent.mkdir(parents=True, exist_ok=True)
        (home / "clone" / name).write_bytes((ROOT / name).read_bytes())
    release = load_script("release")
    wheel, source = sorted(release.build(home / "clone", home), key=lambda path: path.suffix, reverse=True)
    return source, wheel, tracked


@pytest.fixture(scope="module")
def clean(built, tmp_path_factory, load_script):
    """Folder with the programs of a new environment, and what the wheel and its dependencies take [bytes]."""
    home = tmp_path_factory.mktemp("clean")
    run(sys.executable, "-m", "venv", home / "empty", cwd=home)
    programs = load_script("release").install(built[1], home / "venv")
    return programs, installed_bytes(home / "venv") - installed_bytes(home / "empty")


def test_both_are_complete(built):
    with tarfile.open(built[0]) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    assert {name for name in set(built[2]) - held if not name.startswith(".")} == set()
    names = zipfile.ZipFile(built[1]).namelist()
    shared = {re.sub(r"^.*\.data/data/share/soilmoist_ros/", "", name) for name in names if "/data/share/" in name}
    folders = ("config/", "launch/", "examples/")
    assert {name for name in built[2] if name.startswith(folders)} <= shared
    assert not [name for name in names if name.startswith(("test", "scripts", "docs")) or name.endswith(".pyc")]


def test_the_core_is_light(clean):
    programs, size = clean
    assert size < MAX_INSTALLED_BYTES
    listed = {path.name for path in programs.parent.glob("lib/python*/site-packages/*")}
    assert listed & HEAVY == set()
    run(
        programs / "python", "-c", "import soilmoist_ros.mapping as m; m.Variogram, m.PoissonKriging", cwd=programs
    )


def test_a_survey_is_mapped_and_a_mission_simulated_from_installed_files_only(clean, tmp_path):
    programs, _ = clean
    version = run(programs / "soilmoist", "--version", cwd=tmp_path).stdout
    assert re.search(r"\d+\.\d+\.\d+", version)
    log = programs.parent / "share/soilmoist_ros/examples/rover_gypsum_transect_2018-05-01.KSU"
    done = run(
        programs / "soilmoist", "map", log, "--site", "gypsum_transect", "--field", "example", "--out", "out",
        cwd=tmp_path, code=2,
    )  # fmt: skip
    assert "records lie" in done.stderr  # the field of the example is elsewhere: it was found
    done = run(programs / "soilmoist", "map", log, "--site", "gypsum_transect", "--out", "out", cwd=tmp_path)
    assert f"map.tif, report.html, soilmoist.qgs not written: {REMEDY}" in done.stderr
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "summary.json", "samples.geojson", "records.csv"
    }  # fmt: skip
    assert '"EPSG:32614"' in (tmp_path / "out/summary.json").read_text()
    command = ["simulate", "--field", "patches", "--hours", "0.2", "--out", "mission"]
    run(programs / "soilmoist", *command, cwd=tmp_path)
    assert {"summary.json", "series.csv", "visits.csv"} <= {path.name for path in (tmp_path / "mission").iterdir()}


@pytest.mark.parametrize(
    ("command", "extra"),
    [
        (["bag", "info", "bag"], "bags"),
        (["campaign", "paper", "--out", "out"], "campaign"),
        (["simulate", "--field", "patches", "--strategy", "lattice", "--out", "out"], "campaign"),
    ],
)
def test_what_needs_an_extra_says_so(clean, tmp_path, command, extra):
    done = run(clean[0] / "soilmoist", *command, cwd=tmp_path, code=2)
    assert f"pip install 'soilmoist_ros[{extra}]'" in done.stderr
    assert list(tmp_path.iterdir()) == []
