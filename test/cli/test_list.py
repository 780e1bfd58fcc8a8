# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist list``: names, traits and files of all that can be chosen."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from soilmoist_ros.cli.list import KINDS
from soilmoist_ros.cli.main import main


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


@pytest.mark.parametrize("kind", ["strategies", "dwell-rules", "models", "loggers", "sites", "exports"])
def test_each_item_says_what_it_is_and_where(kind):
    items = json.loads(listed(kind, "--json"))["items"]
    text = listed(kind)
    for item in items:
        assert item["about"]
        assert f"\n{item['name']} " in f"\n{text}"
        assert (item["file"] is None) == (kind not in ("loggers", "sites"))
        assert item["file"] is None or Path(item["file"]).is_file()
    assert "A name is given to: --" in text


@pytest.mark.slow
def test_fields_have_size_and_moisture():
    fields = {item["name"]: item for item in json.loads(listed("fields", "--json"))["items"]}
    assert fields["half-wet"]["moisture"] == "8 to 28 % by volume"
    assert fields["half-wet"]["size"] == "60 x 50 m"
    assert fields["smooth"]["rate"].endswith("counts/s")
    assert fields["example"]["simulated"] is False


def test_an_unknown_kind_names_all():
    result = CliRunner().invoke(main, ["list", "robots"])
    assert result.exit_code == 2
    assert "'dwell-rules'" in result.output
