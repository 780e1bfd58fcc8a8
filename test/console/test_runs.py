# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs on a computer and what a page may do with them (runs.py), and files to choose (plan_routes.py)."""

from __future__ import annotations

import asyncio
import json
import os
import time
from pathlib import Path

import pytest

from soilmoist_ros.console import plan_routes as module
from soilmoist_ros.console.board import Board
from soilmoist_ros.console.plan_routes import START, SurveyFiles
from soilmoist_ros.console.runs import Jobs, RunRoutes, file_of, list_runs
from soilmoist_ros.exploration.control.operator_request import OperatorRequest
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
    wrong = f'{{"survey_duration_s": NaN, "distance_m": {"9" * 400}, "mission": {{"stops": "x"}}}}'
    (folder / "first" / "summary.json").write_text(wrong)
    (first,) = (run for run in list_runs(folder) if run["name"] == "first")
    assert (first["duration_s"], first["distance_m"], first["stops"]) == (None, None, None)


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
    assert make(folder, what="export", runs=["first"], formats=["sheet"]) == [
        ("export first", [*cli, "export", "first", "--to", "sheet"])
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


# Files that a page may choose ----------------------------------------------------------------------------------


@pytest.fixture
def files(tmp_path):
    (tmp_path / "runs" / "may").mkdir(parents=True)
    (tmp_path / "runs" / "may" / "summary.json").write_text("{}")
    (tmp_path / "outside.yaml").touch()
    (tmp_path / "fields").mkdir()
    (tmp_path / "fields" / "secret.txt").touch()
    return SurveyFiles(tmp_path / "fields", tmp_path / "runs", tmp_path / "own.yaml")


def test_names_become_paths(files, tmp_path):
    name = files.save("../../North /field", "polygon: []\n", "Ada")
    assert (tmp_path / "fields" / name).read_text().startswith("# Drawn on the operator's page by Ada, 20")
    assert name.startswith("north-field-2")
    os.utime(tmp_path / "fields" / name, (1.0, 1.0))  # some file systems count time in steps of milliseconds
    second = files.save("../../North /field", "polygon: []\n", "")
    assert files.listed() == {"fields": [second, name]}
    asked = OperatorRequest("change", field=name, earlier=("may",), hours=1.0)
    found = files.resolved(asked)
    assert found.field == str(tmp_path / "fields" / name)
    assert found.earlier == (str(tmp_path / "runs" / "may"),)
    assert found.hours == 1.0
    assert files.resolved(OperatorRequest("change", field=START)).field == str(tmp_path / "own.yaml")
    assert files.resolved(OperatorRequest("change", earlier=())).earlier == ()
    start = OperatorRequest("start")
    assert files.resolved(start) is start


@pytest.mark.parametrize(
    "asked",
    [
        {"field": "../outside.yaml"}, {"field": "/etc/passwd"}, {"field": "gone.yaml"}, {"field": "secret.txt"},
        {"earlier": ("..",)},
        {"earlier": ("../runs/may",)},
    ],
)  # fmt: skip
def test_other_files_cannot_be_named(files, asked):
    with pytest.raises(InputError, match="there is no"):
        files.resolved(OperatorRequest("change", **asked))


def test_a_disk_is_not_filled_with_fields(files, monkeypatch):
    monkeypatch.setattr(module, "MAX_FIELDS", 1)
    files.save("one", "x", "")
    with pytest.raises(InputError, match="already"):
        files.save("two", "x", "")
    with pytest.raises(InputError, match="cannot be saved"):
        SurveyFiles(Path("/dev/null/x"), Path()).save("one", "x", "")
