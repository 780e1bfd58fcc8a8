# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from soilmoist_ros.foundation.plain_values import shown_path, shown_text


@pytest.mark.parametrize(
    ("path", "shown"),
    [("logs/may.csv", "logs/may.csv"), ("/data/My logs/may.csv", "may.csv"), (r"C:\logs\may.csv", "may.csv")],
)
def test_a_path_for_others_has_no_folders_of_this_computer(path, shown):
    assert shown_path(path) == shown


def test_a_message_loses_folders_but_no_topics_units_or_addresses(tmp_path):
    (tmp_path / "logs").mkdir()
    assert shown_text(f"{tmp_path}/logs/may.csv:21: no fix ({tmp_path}/a.yaml)") == "may.csv:21: no fix (a.yaml)"
    kept = "0.2 m3/m3 on /robot_1/fix from https://example.org/a/b, and/or 3 counts/s"
    assert shown_text(kept) == kept
