# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rules of the house beyond imports: budgets and doors of the rooms, a test for each long file, the vocabulary."""

import ast
import importlib
import re
import subprocess
from pathlib import Path
from types import FunctionType

import pytest

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = sorted(path.parent.name for path in (ROOT / "soilmoist_ros").glob("*/__init__.py"))
NO_DOORS = ("cli", "replay")
"""Nobody imports the command, and ``replay`` is an old name."""
ROOMS = ("soilmoist_ros", *(f"soilmoist_ros.{name}" for name in FOLDERS if name not in NO_DOORS), "msg_adapters")
LONG = 150
"""Number of lines from which a file must have tests."""
COUNTED = {".py", ".js", ".css", ".html", ".j2"}
"""Endings of the files whose lines have a budget; in ``scripts`` files without an ending, too."""
BUDGET_ROW = re.compile(r"^\| `([\w/]+)/` \| ([\d,]+) \| (\d+) \|$", re.MULTILINE)
LICENCE = (b"SPDX-FileCopyrightText: ", b"SPDX-License-Identifier: ")
CODE = (".py", ".js", ".css", ".cmake")
"""Endings of source files; those that begin with ``#!`` are, too."""
AVOIDED = re.compile(r"(?<!--)\b(beside|errands?)\b", re.IGNORECASE)  # an option is called --beside
LIMITS = re.compile(r"\b_?(MOST|FEWEST|LEAST|LONGEST|SHORTEST)_[A-Z]")


def product() -> list[Path]:
    return [path for name in ("soilmoist_ros", "msg_adapters") for path in sorted((ROOT / name).rglob("*.py"))]


def door(folder):
    if folder in ("soilmoist_ros.nodes", "msg_adapters"):
        pytest.importorskip("rclpy")
    return importlib.import_module(folder)


@pytest.mark.parametrize("folder", ROOMS)
def test_each_room_has_a_door(folder):
    module = door(folder)
    assert module.__doc__
    for name in module.__all__:
        assert getattr(module, name) is not None
    assert dir(module) == module.__all__
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


@pytest.mark.parametrize("folder", ROOMS)
def test_all_that_is_public_is_documented(folder):
    module = door(folder)
    things = {name: getattr(module, name) for name in module.__all__}
    public = {name: thing for name, thing in things.items() if isinstance(thing, FunctionType | type)}
    assert [name for name, thing in public.items() if not (thing.__doc__ or "").strip()] == []


def listed() -> list[str]:
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [name for name in names.split("\0") if (ROOT / name).is_file()]


def room_of(name: str) -> str:
    folders = name.split("/")[:-1]
    return "/".join(folders[: 2 if folders[:1] == ["soilmoist_ros"] else 1])


def test_rooms_keep_their_budget():
    """Whoever wants more lines or files takes them from another room, in the table of CONTRIBUTING.md."""
    table = BUDGET_ROW.findall((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))
    budget = {room: (int(lines.replace(",", "")), int(files)) for room, lines, files in table}
    found = dict.fromkeys(budget, (0, 0))
    for name in listed():
        room, suffix = room_of(name), Path(name).suffix
        if suffix in COUNTED or (room == "scripts" and not suffix):
            lines, files = found.get(room, (0, 0))
            if room in found or room.startswith(("soilmoist_ros/", "msg_adapters")):
                found[room] = (lines + (ROOT / name).read_bytes().count(b"\n"), files + 1)
    assert set(found) == set(budget), "each room has a row"
    over = {
        room: size for room, size in found.items() if any(a > b for a, b in zip(size, budget[room], strict=True))
    }
    assert over == {}, f"beyond { ({room: budget[room] for room in over}) }"


def test_long_files_have_their_tests():
    """A test file of the same name, or one of the folder or the room that names the file."""
    missing = []
    for path in product():
        if path.name == "__init__.py" or len(path.read_text().splitlines()) < LONG:
            continue
        inside = path.relative_to(ROOT)
        parts = inside.parts[:-1] if inside.parts[0] == "msg_adapters" else inside.parts[1:-1]
        own = ROOT / "test" / Path(*parts) / f"test_{path.stem}.py"
        names = (path.name, ".".join(inside.with_suffix("").parts))
        tests = (ROOT / "test" / parts[0]).rglob("test_*.py")
        if not own.is_file() and not any(name in each.read_text() for each in tests for name in names):
            missing.append(str(inside))
    assert missing == []


def test_every_source_file_says_whose_it_is_and_under_which_licence():
    missing = []
    for name in listed():
        path = ROOT / name
        with path.open("rb") as file:
            first = file.read(300)
        if first and (path.suffix in CODE or path.name == "CMakeLists.txt" or first.startswith(b"#!")):
            lines = first.splitlines()[:3]
            said = [word for word in LICENCE if any(word in line for line in lines)]
            missing += [name] if len(said) < len(LICENCE) else []
    assert missing == [], f"begin with the same two lines as {Path(__file__).name}"


def test_pages_and_changes_stay_short():
    """Tables that scripts write into a page are not counted."""
    pages = list((ROOT / "docs").glob("*.md"))
    made = re.compile(r"^<!-- (?:made: .*?^<!-- end|(\w+) -->$.*?^<!-- end of \1) -->$", re.M | re.S)
    prose = [made.sub("", page.read_text()) for page in pages]
    assert len(pages) <= 28
    assert sum(len(text.split()) for text in prose) <= 32_000
    assert len((ROOT / "CHANGELOG.rst").read_text().splitlines()) <= 250


@pytest.mark.slow
def test_words_of_the_vocabulary():
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in [*product(), ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
        for number, line in enumerate(path.read_text().splitlines(), 1)
        if AVOIDED.search(line) or LIMITS.search(line)
    ]
    assert found == []
