# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rules of the house beyond imports: a public API for each folder, a test for each file, the vocabulary."""

import importlib
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CORE = (
    "foundation", "sensing", "mapping", "exploration", "simulation", "recording", "reporting", "replay", "console",
)  # fmt: skip
MAX_NAMES = 12
"""Highest number of names in the public API of a folder."""
LONG = 102
"""Number of lines from which a file must have tests; two of them are its licence."""
LICENCE = (b"SPDX-FileCopyrightText: ", b"SPDX-License-Identifier: ")
CODE = (".py", ".js", ".css", ".cmake")
"""Endings of source files; those that begin with ``#!`` are, too."""
AVOIDED = re.compile(r"\b(beside|errands?)\b", re.IGNORECASE)
LIMITS = re.compile(r"\b_?(MOST|FEWEST|LEAST|LONGEST|SHORTEST)_[A-Z]")


def product() -> list[Path]:
    """Every source file of the product."""
    return [path for name in ("soilmoist_ros", "msg_adapters") for path in sorted((ROOT / name).rglob("*.py"))]


@pytest.mark.parametrize("name", ["soilmoist_ros", *(f"soilmoist_ros.{folder}" for folder in CORE)])
def test_each_folder_names_its_public_api(name):
    module = importlib.import_module(name)
    names = [each for each in module.__all__ if each != "__version__"]
    assert 0 < len(names) <= MAX_NAMES, f"{name} shows {len(names)} names"
    assert sorted(names) == sorted(set(names))
    for each in names:
        assert getattr(module, each) is not None
    assert module.__doc__


def test_all_that_is_public_is_documented():
    undocumented = []
    for folder in ("soilmoist_ros", *(f"soilmoist_ros.{folder}" for folder in CORE)):
        module = importlib.import_module(folder)
        for name in module.__all__:
            thing = getattr(module, name)
            if (callable(thing) or isinstance(thing, type)) and not (thing.__doc__ or "").strip():
                undocumented.append(f"{folder}.{name}")
    assert undocumented == []


def test_long_files_have_their_tests():
    missing = []
    for path in product():
        if path.name == "__init__.py" or len(path.read_text().splitlines()) < LONG:
            continue
        inside = path.relative_to(ROOT)
        folder = (
            ROOT / "test" / (inside.parent if inside.parts[0] == "msg_adapters" else Path(*inside.parts[1:-1]))
        )
        own = folder / f"test_{path.stem}.py"
        neighbours = [*folder.glob("test_*.py"), *folder.parent.glob("test_*.py")]
        names = (path.name, ".".join(inside.with_suffix("").parts))
        if not own.is_file() and not any(name in each.read_text() for name in names for each in neighbours):
            missing.append(str(inside))
    assert missing == []


def test_every_source_file_says_whose_it_is_and_under_which_licence():
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    missing = []
    for name in listed.split("\0"):
        path = ROOT / name
        if not path.is_file():
            continue
        with path.open("rb") as file:
            first = file.read(300)
        if first and (path.suffix in CODE or path.name == "CMakeLists.txt" or first.startswith(b"#!")):
            lines = first.splitlines()[:3]
            said = [word for word in LICENCE if any(word in line for line in lines)]
            missing += [name] if len(said) < len(LICENCE) else []
    assert missing == [], f"begin with the same two lines as {Path(__file__).name}"


def test_words_of_the_vocabulary():
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in [*product(), ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
        for number, line in enumerate(path.read_text().splitlines(), 1)
        if AVOIDED.search(line) or LIMITS.search(line)
    ]
    assert found == []
