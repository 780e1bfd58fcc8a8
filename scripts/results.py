# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of measured figures: the scripts that measure print them, and with --save write them to docs/data/.

A file is CSV below lines that begin with ``#`` and state how it was made: settings, command, date, machine, note.
Pages have the tables where they say ``<!-- made: data/NAME.csv -->``: ``scripts/docs --tables`` writes them there.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from itertools import takewhile
from pathlib import Path

from soilmoist_ros import __version__

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "data"
FACTS = ("settings", "command", "version", "date", "machine", "note")
LOAD = os.getloadavg()[0]  # before the script measures
NUMBER = re.compile(r"[-−+±]?[\d.,]+(e[-+]?\d+)?( ?±.*| ?%| \d[\d ]*)?|")

FOLDERS = (
    "sensing",
    "mapping",
    "exploration",
    "simulation",
    "recording",
    "pipeline",
    "reporting",
    "console",
    "lab",
    "foundation",
)
"""Folders of the package that have a page of their names."""
MADE = re.compile(r"(?<=^<!-- made: )(.+?)( -->\n).*?(?=^<!-- end -->$)", re.MULTILINE | re.DOTALL)
"""What scripts write into a page: its name, and all up to the end."""
CAPTION = 240
"""Longest settings below a table in a page; the file has all."""


@dataclass(frozen=True)
class Table:
    """Measured figures.

    :param columns: heads of the columns
    :param rows: cells as text
    :param facts: how they were made, by the names in :data:`FACTS`
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    facts: dict[str, str] = field(default_factory=dict)


def parser(description: str | None) -> argparse.ArgumentParser:
    """Options of a script that measures."""
    made = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("--save", action="store_true", help="write the tables to docs/data, for the site")
    return made


def publish(
    name: str, columns: Sequence[str], rows: Iterable[Sequence[object]], settings: str, save: bool
) -> None:
    """Print a table, and write it to ``docs/data/NAME.csv``.

    :param settings: what the figures depend on besides the command
    :param save: whether it is written
    """
    arguments = shlex.join(argument for argument in sys.argv[1:] if argument != "--save")
    facts = {
        "settings": settings,
        "command": f".venv/bin/python scripts/{Path(sys.argv[0]).name} {arguments}".strip(),
        "version": version(),
        "date": date.today().isoformat(),
        "machine": machine(),
    }
    table = Table(columns, [[str(cell) for cell in row] for row in rows], facts)
    print(f"\n{markdown(table)}\n", flush=True)
    if save:
        write(table, FOLDER / f"{name}.csv")


def columns_and_rows(found: Sequence[Mapping[str, object]]) -> tuple[list[str], list[list[str]]]:
    """Head and rows of a table, of rows whose keys are names of columns; numbers are rounded."""
    columns = [column.replace("_", " ") for column in found[0]]
    return columns, [[_readable(value) for value in row.values()] for row in found]


def _readable(value: object) -> str:
    if not isinstance(value, float):
        return str(value)
    return f"{value:.2f}" if abs(value) < 10 else f"{value:,.0f}"


def machine() -> str:
    """Processor, its cores, and how busy they were before."""
    cpuinfo = Path("/proc/cpuinfo")
    found = re.search(r"^model name\s*: (.*)", cpuinfo.read_text() if cpuinfo.exists() else "", re.MULTILINE)
    name = found[1] if found else platform.processor() or platform.machine()
    return f"{name}, {os.cpu_count()} cores, load {LOAD:.1f}, Python {platform.python_version()}"


def version() -> str:
    """Version of the package that is measured, and the last commit that changed it where that is known."""
    git = shutil.which("git") or "false"
    last = [git, "-C", str(ROOT), "log", "-1", "--format=, commit %h", "--", "soilmoist_ros"]
    found = subprocess.run(last, capture_output=True, text=True, check=False).stdout.strip()
    return f"soilmoist_ros {__version__}{found}"


def write(table: Table, path: Path) -> None:
    """Write a table with how it was made."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        stream.writelines(f"# {name}: {table.facts[name]}\n" for name in FACTS if table.facts.get(name))
        csv.writer(stream, lineterminator="\n").writerows([table.columns, *table.rows])


def read(path: Path) -> Table:
    """A table that was written."""
    lines = path.read_text(encoding="utf-8").splitlines()
    about = list(takewhile(lambda line: line.startswith("# "), lines))
    columns, *rows = csv.reader(lines[len(about) :])
    return Table(columns, rows, dict(line[2:].split(": ", 1) for line in about))


def excerpt(name: str) -> str:
    """A table for a page, by the name of its file and the numbers of rows and columns that matter, all without.

    For example ``data/zoo.csv rows 1 3 columns 1 2 5``.
    """
    path, *words = name.split()
    wanted: dict[str, list[int]] = {"rows": [], "columns": []}
    for word in words:
        if word in wanted:
            picked = wanted[word]
        else:
            picked.append(int(word) - 1)
    table = read(FOLDER.parent / path)
    columns = wanted["columns"] or range(len(table.columns))
    rows = [table.rows[row] for row in wanted["rows"] or range(len(table.rows))]
    link = f"[All {len(table.rows)} rows]({path})" if words else f"[File]({path})"
    settings = table.facts.get("settings", "")
    if len(settings) > CAPTION:
        settings = settings[:CAPTION].rpartition("; ")[0] + "; …"
    facts = table.facts | {"settings": settings}
    shown = Table([table.columns[at] for at in columns], [[row[at] for at in columns] for row in rows], facts)
    return f"{markdown(shown, aligned=False)} {link}."


def markdown(table: Table, aligned: bool = True) -> str:
    """A table as text, numbers on the right, and a paragraph on how it was made.

    :param aligned: whether the columns are as wide as their cells, for a terminal
    """
    lines = [[cell.replace("|", "\\|") for cell in line] for line in (table.columns, *table.rows)]
    columns = list(zip(*lines, strict=True))
    right = [all(NUMBER.fullmatch(cell) for cell in column[1:]) for column in columns]
    widths = [max(3, *map(len, column)) if aligned else 3 for column in columns]
    rule = ["-" * (width - 1) + (":" if numbers else "-") for width, numbers in zip(widths, right, strict=True)]
    text = "\n".join(
        "| "
        + " | ".join(
            cell.rjust(width) if numbers else cell.ljust(width)
            for cell, width, numbers in zip(line, widths, right, strict=True)
        )
        + " |"
        for line in (lines[0], rule, *lines[1:])
    )
    facts = {name: value for name, value in table.facts.items() if value}
    if "command" in facts and facts["command"].startswith(("scripts/", ".venv/", "soilmoist ")):
        facts["command"] = f"`{facts['command']}`"
    about = ". ".join(facts[name].rstrip(".") for name in FACTS if name in facts)
    return text + (f"\n\n{about[0].upper()}{about[1:]}." if about else "")
