# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The runs on a computer and what the page may do with them (runs.py, run_routes.py, jobs.py)."""

from __future__ import annotations

import asyncio
import json
import time

import pytest

from soilmoist_ros.console.board import Board
from soilmoist_ros.console.runs import Jobs, RunRoutes, file_of, list_runs
from soilmoist_ros.foundation.errors import InputError


@pytest.fixture
def folder(tmp_path):
    """Two runs, one with results and one that is a recording only, and what must not be shown."""
    home = tmp_path / "runs"
    for name in ("first/bag", "first/configuration", "first/log", "second", "other", "second/.hidden"):
        (home / name).mkdir(parents=True)
    summary = {
        "field": "North", "survey_start_utc": "2026-06-01T06:00:00Z", "survey_duration_s": 60.0,
        "mission": {"stops": 3}, "map": {"vwc": {"mean": 0.2}},
    }  # fmt: skip
    for name, text in {
        "first/summary.json": json.dumps(summary), "first/report.html": "<p>", "first/bag/bag_0.mcap": "x",
        "first/log/planner.log": "secret", "first/log/a.json": "secret", "second/metadata.yaml": "x",
        "second/.hidden/a.json": "secret", "second/key.pem": "secret", "other/a.json": "secret",
    }.items():  # fmt: skip
        (home / name).write_text(text)
    (tmp_path / "outside.json").write_text("secret")
    (home / "second" / "link.json").symlink_to(tmp_path / "outside.json")
    (home / "linked").symlink_to(home / "first")
    return home


def test_runs_are_listed_with_what_is_known(folder):
    runs = {run["name"]: run for run in list_runs(folder)}
    assert set(runs) == {"first", "second"}
    first = runs["first"]
    assert (first["field"], first["stops"], first["vwc"], first["report"]) == ("North", 3, 0.2, True)
    assert [name for name, _ in first["files"]] == ["bag/bag_0.mcap", "report.html", "summary.json"]
    assert [name for name, _ in runs["second"]["files"]] == ["metadata.yaml"]
    assert (runs["second"]["recording"], runs["second"]["report"]) == (True, False)
    json.dumps(list(runs.values()), allow_nan=False)
    assert list_runs(folder / "none") == []


def test_numbers_of_a_summary_that_are_none_are_left_out(folder):
    digits = "9" * 400
    text = f'{{"survey_duration_s": NaN, "distance_m": {digits}, "mission": {{"stops": "x"}}}}'
    (folder / "first" / "summary.json").write_text(text)
    (first,) = (run for run in list_runs(folder) if run["name"] == "first")
    assert (first["duration_s"], first["distance_m"], first["stops"]) == (None, None, None)
    json.dumps(first, allow_nan=False)


@pytest.mark.parametrize(
    ("run", "name"),
    [
        ("first", "log/planner.log"), ("first", "log/a.json"), ("first", "../../outside.json"),
        ("first", "/etc/hosts"),
        ("second", "link.json"), ("second", ".hidden/a.json"), ("second", "key.pem"), ("other", "a.json"),
        ("..", "outside.json"), (".", "first/summary.json"), ("linked", "summary.json"), ("first", "none.json"),
        ("first", "bag"), ("", "first/summary.json"),
    ],
)  # fmt: skip
def test_nothing_else_can_be_taken(folder, run, name):
    assert file_of(folder, run, name) is None


class Asked:
    """Jobs that are only noted."""

    def __init__(self):
        self.jobs = []

    def start(self, name, arguments):
        self.jobs.append((name, [word.rpartition("/")[2] for word in arguments]))
        return ""


def make(folder, **content):
    asked = Asked()
    asyncio.run(RunRoutes(None, folder, asked)._on_make(content))
    return asked.jobs


def test_reports_exports_and_comparisons_are_made_by_the_commands(folder):
    cli = ["-m", "soilmoist_ros.cli.main"]
    assert make(folder, what="report", runs=["second"]) == [
        ("report second", [*cli, "replay", "second", "--out", "second"])
    ]
    assert make(folder, what="export", runs=["first"], formats=["kmz"]) == [
        ("export first", [*cli, "export", "first", "--to", "kmz"])
    ]
    ((_, words),) = make(folder, what="compare", runs=["second", "first"])
    assert words[2:] == ["season", "first", "second", "--out", "compared-first-second", "--overwrite"]


@pytest.mark.parametrize(
    "content",
    [
        {"what": "report", "runs": ["../x"]}, {"what": "report", "runs": []}, {"what": "report"},
        {"what": "compare", "runs": ["first"]}, {"what": "delete", "runs": ["first"]},
        {"what": "export", "runs": ["first"], "formats": ["--out"]}, {"what": "export", "runs": ["first"]},
    ],
)  # fmt: skip
def test_what_is_not_made(folder, content):
    with pytest.raises(InputError):
        make(folder, **content)


@pytest.mark.slow
def test_jobs_run_one_after_the_other_and_say_how_they_ended():
    board = Board()

    async def work():
        jobs = Jobs(board)
        assert jobs.start("good", ["-c", "import os; print('niceness', os.nice(0))"]) == ""
        assert jobs.start("bad", ["-c", "raise SystemExit('it is broken')"]) == ""
        assert "already" in jobs.start("good", ["-c", ""])
        code, said = await jobs.answer(["-c", "print(input()[::-1])"], b"abc\n", 60.0)
        assert (code, said) == (0, b"cba\n")
        with pytest.raises(TimeoutError):
            await jobs.answer(["-c", "import time; time.sleep(100)"], b"", 0.3)
        deadline = time.monotonic() + 60
        while "running" in [job["state"] for job in board.get("jobs").values()] and time.monotonic() < deadline:
            await asyncio.sleep(0.02)
        await jobs.close()

    asyncio.run(work())
    shown = board.get("jobs")
    assert shown["good"]["state"] == "done"
    assert int(shown["good"]["text"].split()[-1]) >= 10
    assert shown["bad"] == {"state": "failed", "text": "it is broken"}
