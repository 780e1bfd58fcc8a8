# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files that a page may choose (survey_files.py)."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from soilmoist_ros.console import plan_routes as module
from soilmoist_ros.console.plan_routes import START, SurveyFiles
from soilmoist_ros.exploration.control.operator_request import OperatorRequest
from soilmoist_ros.foundation.errors import InputError


@pytest.fixture
def files(tmp_path):
    (tmp_path / "covariates").mkdir()
    (tmp_path / "covariates" / "height.TIF").touch()
    (tmp_path / "covariates" / "secret.txt").touch()
    (tmp_path / "runs" / "may").mkdir(parents=True)
    (tmp_path / "runs" / "may" / "summary.json").write_text("{}")
    (tmp_path / "outside.yaml").touch()
    return SurveyFiles(tmp_path / "fields", tmp_path / "covariates", tmp_path / "runs", tmp_path / "own.yaml")


def test_names_become_paths(files, tmp_path):
    name = files.save("../../North /field", "polygon: []\n", "Ada")
    assert (tmp_path / "fields" / name).read_text().startswith("# Drawn on the operator's page by Ada, 20")
    assert name.startswith("north-field-2")
    os.utime(tmp_path / "fields" / name, (1.0, 1.0))  # some file systems count time in steps of milliseconds
    second = files.save("../../North /field", "polygon: []\n", "")
    assert files.listed() == {
        "fields": [second, name], "fields_folder": str(tmp_path / "fields"),
        "covariates": ["height.TIF"], "covariates_folder": str(tmp_path / "covariates"),
    }  # fmt: skip
    asked = OperatorRequest("change", field=name, earlier=("may",), covariates=("height.TIF",), hours=1.0)
    found = files.resolved(asked)
    assert found.field == str(tmp_path / "fields" / name)
    assert found.earlier == (str(tmp_path / "runs" / "may"),)
    assert found.covariates == (str(tmp_path / "covariates" / "height.TIF"),)
    assert found.hours == 1.0
    assert files.resolved(OperatorRequest("change", field=START)).field == str(tmp_path / "own.yaml")
    assert files.resolved(OperatorRequest("change", earlier=())).earlier == ()
    start = OperatorRequest("start")
    assert files.resolved(start) is start


@pytest.mark.parametrize(
    "asked",
    [
        {"field": "../outside.yaml"}, {"field": "/etc/passwd"}, {"field": "gone.yaml"}, {"earlier": ("..",)},
        {"earlier": ("../runs/may",)}, {"covariates": ("secret.txt",)}, {"covariates": ("../outside.yaml",)},
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
        SurveyFiles(Path("/dev/null/x"), Path(), Path()).save("one", "x", "")
