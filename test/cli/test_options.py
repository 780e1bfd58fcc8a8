# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Completion of names in the shell (names.py)."""

import pytest
from click.shell_completion import ShellComplete

from soilmoist_ros.cli.main import main


def completed(*words):
    *before, last = words
    items = ShellComplete(main, {}, "soilmoist", "_SOILMOIST_COMPLETE").get_completions(before, last)
    return [item.value for item in items if item.type == "plain"], {item.type for item in items}


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["simulate", "--field", "hal"], ["half-wet", "halves"]),
        (["simulate", "--strategy", "g"], ["greedy", "gcb"]),
        (["demo", "--dwell", ""], ["fmi:", "ami:", "optimal"]),
        (["simulate", "--preset", "p"], ["paper"]),
        (["map", "--logger", "hydro"], ["hydroinnova_crs1000", "hydroinnova_rover"]),
        (["map", "--site", "gy"], ["gypsum_transect"]),
        (["map", "--model", "mat"], ["matern32", "matern52"]),
        (["export", "run", "--to", "k"], ["kmz"]),
        (["campaign", "pa"], ["paper"]),
        (["list", "log"], ["loggers"]),
        (["sim"], ["simulate"]),
    ],
)
def test_names_are_completed(words, names):
    assert completed(*words)[0] == names


def test_files_are_completed_where_a_file_will_do():
    assert completed("map", "--site", "")[1] == {"plain", "file"}
    assert completed("simulate", "--strategy", "")[1] == {"plain"}
