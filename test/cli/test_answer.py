# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lines for people, JSON for programs, errors and exit codes (answer.py, progress.py)."""

from __future__ import annotations

import json
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from soilmoist_ros.cli.answer import answering, progress_bar, put, reporting_errors, say, warn, wrote
from soilmoist_ros.foundation.errors import InputError, Mistake, SoilmoistError


def run(body, *options):
    @click.command("try")
    @answering
    def command():
        body()

    return CliRunner().invoke(command, list(options))


def work():
    with progress_bar() as progress:
        progress("working", 0.5)
    say("rate       3.2")
    put(rate=3.2, missing=float("nan"))
    warn("warning    dry")
    wrote([Path("map.tif")])


def test_progress_without_a_terminal_is_a_line_per_tenth(capsys):
    with progress_bar() as progress:
        for done in range(101):
            progress("100 missions", done / 100)
    tenths = [f"... 100 missions: {done} %" for done in range(10, 100, 10)]
    assert capsys.readouterr().err.splitlines() == ["... 100 missions", *tenths]


def test_people_read_lines_and_progress_goes_to_standard_error_and_quiet_leaves_warnings():
    result, quiet = run(work), run(work, "--quiet")
    assert (result.stdout, result.stderr) == ("rate       3.2\nwarning    dry\nwrote map.tif\n", "... working\n")
    assert (quiet.stdout, quiet.stderr) == ("", "warning    dry\n")


def test_programs_read_one_json_object_and_nothing_else_on_standard_output():
    result = run(work, "--json")
    assert json.loads(result.stdout) == {
        "command": "", "exit_code": 0, "errors": [], "rate": 3.2, "missing": None, "warnings": ["warning    dry"],
        "written": ["map.tif"],
    }  # fmt: skip
    assert result.stderr == "... working\nrate       3.2\nwarning    dry\nwrote map.tif\n"


@pytest.mark.parametrize(
    ("error", "code", "printed"),
    [
        (InputError([Mistake("one", "mend it"), Mistake("two")]), 2, "error: one -> mend it\nerror: two\n"),
        (SoilmoistError("broken"), 1, "error: broken\n"),
        (KeyboardInterrupt(), 130, "interrupted: nothing was written\n"),
        (SystemExit(1), 1, ""),
    ],
)
def test_errors_become_messages_and_exit_codes(error, code, printed, capsys):
    def fail():
        raise error

    result = run(fail)
    assert (result.exit_code, result.stderr) == (code, printed)
    assert json.loads(run(fail, "--json").stdout)["exit_code"] == code
    with pytest.raises(SystemExit) as ended:
        reporting_errors(fail)()
    assert ended.value.code == code
    assert capsys.readouterr().err == printed


def test_a_terminal_obeys_no_characters_of_a_file():
    name = "north\x1b]0;title\x07 5 m³"

    def body():
        with progress_bar() as progress:
            progress(name, 0.5)
        say(f"field      {name}")
        warn(f"{name}\n\tdry")
        raise InputError(f"{name} is wrong")

    shown = r"north\x1b]0;title\x07 5 m³"
    result = run(body)
    assert result.stdout == f"field      {shown}\n{shown}\n\tdry\n"
    assert result.stderr == f"... {shown}\nerror: {shown} is wrong\n"


def test_mistakes_have_their_places_in_json():
    def fail():
        raise InputError([Mistake("is wrong", "mend it", Path("site.yaml"), 3, "soil")])

    (mistake,) = json.loads(run(fail, "--json").stdout)["errors"]
    assert mistake == {"message": "is wrong", "remedy": "mend it", "path": "site.yaml", "line": 3, "key": "soil"}


def test_wrong_use_found_by_the_command_is_an_error_in_json():
    def fail():
        raise click.UsageError("give one")

    result = run(fail, "--json")
    assert result.exit_code == 2
    assert json.loads(result.stdout)["errors"][0]["message"] == "give one"
