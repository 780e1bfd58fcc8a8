# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The commands ``list``, ``bag``, ``export`` and ``campaign``."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from soilmoist_ros.cli.bag import command
from soilmoist_ros.cli.failsafe import PHASES, RESPONSES
from soilmoist_ros.cli.list import KINDS
from soilmoist_ros.cli.main import main
from soilmoist_ros.exploration import FAILSAFES, Phase, Response


def listed(*options):
    result = CliRunner().invoke(main, ["list", *options])
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.mark.slow
def test_all_kinds_are_listed_with_their_names():
    found = json.loads(listed("--json"))
    assert set(KINDS) < set(found)
    lines = listed().splitlines()
    for kind in KINDS:
        (line,) = (each for each in lines if each.startswith(f"{kind} "))
        assert [item["name"] for item in found[kind]] == line.removeprefix(kind).strip().split(", ")
        for item in found[kind]:
            assert item["about"]
            in_a_file = kind in ("loggers", "sites", "campaigns", "scenarios")
            assert (item["file"] is not None) == in_a_file or kind == "fields"
            assert item["file"] is None or Path(item["file"]).is_file()
    fields = {item["name"]: item["about"] for item in found["fields"]}
    assert fields["half-wet"].endswith("; 60 x 50 m, 2 h")
    assert fields["example"].endswith(", not simulated")


def test_a_kind_says_what_each_name_is_and_where_it_is_given():
    items, text = json.loads(listed("sites", "--json"))["items"], listed("sites")
    for item in items:
        assert re.search(rf"^{item['name']} +{re.escape(item['about'])}$", text, re.MULTILINE)
    assert "A name is given to: --site" in text
    assert f"Files, to read and copy: {Path(items[0]['file']).parent}/NAME.yaml" in text


def failsafe(*given, code=0):
    result = CliRunner().invoke(main, ["failsafe", *given])
    assert result.exit_code == code, result.output
    return result.stdout if code == 0 else result.output


def test_failsafes_are_told_for_each_phase():
    """What a mission in that phase really does: :func:`consequence` is the mission."""
    assert (list(Phase), list(Response)) == (PHASES, RESPONSES)
    assert all(f"\n{cause} " in f"\n{failsafe()}" for cause in FAILSAFES)
    text = failsafe("off-route", "--response", "pause")
    assert "off_route: pause instead of warn" in text
    assert "limit        off_route_m 5 m" in text
    assert "travelling   cancels the goal, waits for people: 'off route; check the robot, then resume" in text
    assert "watchdog:hold is not possible" in failsafe("watchdog", "--response", "hold", code=2)
    assert "\nwatchdog          pause " in failsafe("--response", "hold")
    content = json.loads(failsafe("moving", "battery_low", "--phase", "counting", "--json"))
    moving, battery = (item["phases"]["counting"]["does"] for item in content["failsafes"])
    assert moving.startswith("cancels all goals of the navigation")
    assert battery == "stops counting, drives home and ends"
    assert "no cause 'offroute' (did you mean 'off_route'?)" in failsafe("offroute", code=2)


def test_an_unknown_kind_names_all():
    result = CliRunner().invoke(main, ["list", "robots"])
    assert result.exit_code == 2
    assert "'dwell-rules'" in result.output


# bag -------------------------------------------------------------------------------------------------------------

GOLDEN = Path(__file__).resolve().parent.parent / "golden" / "one_stop" / "bag"


@pytest.fixture
def bag(tmp_path):
    return shutil.copytree(GOLDEN, tmp_path / "run" / "bag").parent


@pytest.mark.slow
def test_a_bag_is_recovered_and_verified_and_damage_is_named(bag, tmp_path):
    run = CliRunner().invoke
    done = run(command, ["recover", str(bag), "--out", str(tmp_path / "recovered")])
    assert done.exit_code == 0, done.output
    assert "was whole" in done.output
    assert "16 messages" in done.output
    done = run(command, ["verify", str(bag), str(tmp_path / "recovered")])
    assert done.exit_code == 0
    assert done.output.count("whole") == 2
    path = tmp_path / "recovered" / "recovered_0.mcap"
    (found,) = json.loads(run(command, ["verify", str(path.parent), "--json"]).stdout)["bags"]
    assert (found["bag"], found["paths"]) == (str(path.parent), [str(path)]), "as in 0.2.0"
    data = bytearray(path.read_bytes())
    data[data.index(b"zstd") + 40] ^= 1
    path.write_bytes(data)
    done = run(command, ["verify", str(tmp_path / "recovered")])
    assert done.exit_code == 1
    for text in ("is damaged in 1 place", "and metadata.yaml says"):
        assert text in done.output
    done = run(command, ["info", str(tmp_path / "recovered")])
    assert done.exit_code == 1
    assert "soilmoist bag recover" in done.output


# export ----------------------------------------------------------------------------------------------------------


def run(*arguments):
    return CliRunner().invoke(main, ["export", *map(str, arguments)])


def test_bad_input_is_named(tmp_path):
    for arguments, message in (
        ((), "Missing argument 'RUN'"),
        ((tmp_path, "--to", "gpkg"), "holds no summary.json"),
        ((tmp_path, "--to", "kml"), "there is no export 'kml'"),
        ((tmp_path,), "no export is given"),
    ):
        result = run(*arguments)
        assert (result.exit_code, message in result.output) == (2, True), result.output


@pytest.mark.slow
def test_files_of_an_earlier_export_are_replaced_only_when_asked_to(tmp_path):
    home = tmp_path / "run"
    simulated = ("simulate", "--field", "smooth", "--hours", "0.2", "--cell", "6", "--out", home)
    assert CliRunner().invoke(main, [*map(str, simulated)]).exit_code == 0
    assert run(home, "--to", "gpkg").exit_code == 0
    path = home / "export" / "soilmoist.gpkg"
    path.write_text("mine")
    refused = run(home, "--to", "gpkg", "--to", "zones")
    assert refused.exit_code == 2
    assert "has soilmoist.gpkg of an earlier export -> choose another folder, or give --over" in refused.output
    assert (path.read_text(), (home / "export" / "zones.zip").exists()) == ("mine", False)
    assert run(home, "--to", "gpkg", "--overwrite").exit_code == 0
    assert path.read_bytes()[:6] == b"SQLite"
    partly = run(home, "--to", "zones", "--to", "dose", "--overwrite")
    assert (partly.exit_code, (home / "export" / "zones.zip").exists()) == (1, True)
    assert "there is no dose: the sensor is not calibrated" in partly.output


# campaign --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_first_impression_is_part_of_the_campaign_and_a_mission_that_fails_is_named(tmp_path):
    plan = tmp_path / "plan.yaml"
    plan.write_text(
        "title: tiny\nruns: 2\n"
        "experiments: [{name: a, field: synthetic-high, hours: 0.1, preset: paper, cell_m: [5000, 4]}]\n"
    )
    command = ["campaign", str(plan), "--workers", "0", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(main, [*command, "--runs", "1"])
    assert "1 simulated, 0 reused, 1 failed" in result.output
    result = CliRunner().invoke(main, command)
    assert result.exit_code == 1
    assert "1 simulated, 1 reused, 2 failed" in result.output
    assert "cell_m=5000" in result.output
    assert "cannot be gridded" in result.output
    assert "cannot be gridded" in (tmp_path / "out" / "report.html").read_text()
