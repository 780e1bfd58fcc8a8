# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.foundation.plain_values import foreign_text, shown_path, shown_text


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


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Nördlich 5 m³", "Nördlich 5 m³"),
        ("two  blanks", "two  blanks"),
        ("\x1b[1;31mred\x1b[0m", "red"),
        ("\x1b]0;title\x07a\x1b]8;;http://x\x1b\\b", "ab"),
        ("\x9b2Ja\x1b(Bb\x1b", "ab"),
        ("one\r\ntwo\tthree\u2028four", "one two three four"),
        ("abc\u202efed\u2066\u200b\ufeff", "abcfed"),
        ("\ud800lone", "lone"),
        ("\x00\x07", ""),
    ],
)
def test_a_foreign_text_is_one_line_without_control_characters(text, shown):
    assert foreign_text(text) == shown


@given(st.text())
def test_a_foreign_text_can_be_printed_and_stays_as_it_is(text):
    shown = foreign_text(text)
    assert shown.isprintable()
    assert foreign_text(shown) == shown
    assert not text.isprintable() or shown == text
