# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist export`` without a run folder; the files are tested in reporting/exports."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from soilmoist_ros.cli.main import main


def run(*arguments):
    return CliRunner().invoke(main, ["export", *map(str, arguments)])


def test_bad_input_is_named(tmp_path):
    for arguments, message in (
        ((), "Missing argument 'RUN'"),
        ((tmp_path, "--to", "kmz"), "holds no summary.json"),
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
    assert run(home, "--to", "netcdf").exit_code == 0
    path = home / "export" / "map.nc"
    path.write_text("mine")
    refused = run(home, "--to", "netcdf", "--to", "zones")
    assert refused.exit_code == 2
    assert "has map.nc of an earlier export -> choose another folder, or give --overwrite" in refused.output
    assert (path.read_text(), (home / "export" / "zones.zip").exists()) == ("mine", False)
    assert run(home, "--to", "netcdf", "--overwrite").exit_code == 0
    assert path.read_bytes()[:3] == b"CDF"
