# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rules of the house beyond imports: a public API for each folder, a test for each file, the vocabulary."""

import ast
import importlib
import re
import subprocess
from pathlib import Path
from types import FunctionType

import pytest

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = sorted(path.parent.name for path in (ROOT / "soilmoist_ros").glob("*/__init__.py"))
CLOSED = ("cli", "replay")
ROOMS = ("soilmoist_ros", *(f"soilmoist_ros.{name}" for name in FOLDERS if name not in CLOSED), "msg_adapters")
"""Packages with a door; nobody imports the command, and ``replay`` is an old name."""
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


@pytest.mark.parametrize("folder", ROOMS)
def test_each_room_has_a_door(folder):
    module = importlib.import_module(folder)
    assert module.__doc__
    for name in module.__all__:
        assert getattr(module, name) is not None
    source = Path(module.__file__).read_text()
    typed = [
        f"{node.module.removeprefix(folder + '.')} {alias.name}"
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom) and node.module.startswith(f"{folder}.") and node.col_offset
        for alias in node.names
    ]
    table = next(node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Dict))
    opened = [f"{home} {name}" for home, names in ast.literal_eval(table).items() for name in names.split()]
    assert sorted(typed) == sorted(opened), "a type checker sees what Python sees"
    assert len({line.split()[1] for line in opened}) == len(opened), "a name stands for one thing"
    inside = {path.stem for path in Path(module.__file__).parent.iterdir()}
    assert inside & set(module.__all__) == set(), "a module of that name would hide what the door offers"


def test_all_that_is_public_is_documented():
    undocumented = []
    for folder in ROOMS:
        module = importlib.import_module(folder)
        for name in module.__all__:
            thing = getattr(module, name)
            if isinstance(thing, FunctionType | type) and not (thing.__doc__ or "").strip():
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
