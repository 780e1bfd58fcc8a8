# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist export`` without a run folder; the files are tested in reporting/exports."""

from __future__ import annotations

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
