# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Configuration files, their sections (sections.py), plain values (plain_values.py) and errors."""

from __future__ import annotations

import os
import re
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.foundation import InputError, did_you_mean, parse_yaml, read_limited, read_quickly, read_yaml
from soilmoist_ros.foundation.plain_values import foreign_text, shown_text
from soilmoist_ros.foundation.sections import Section, load_model

LAUGHS = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 12)
)
MERGES = "a0: &a0 {k: 1}\n" + "".join(
    f"a{n}: &a{n}\n  <<: [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 9)
)


@pytest.mark.parametrize("kind", ["safe", "rt"])
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[" * 300, "100 levels"),
        ("[" * 300 + "]" * 300, "100 levels"),
        ("{a: " * 300 + "}" * 300, "100 levels"),
        ("- " * 3000 + "a", "100 levels"),
        (LAUGHS, "100000 values"),
        (MERGES, "100000 values"),
        ("a: &a [*a]", "100000 values"),
        ("a: &a {b: *a}", "100000 values"),
        ("a: &a 1\nb: &a [*a]", "100000 values"),
        ("a: *b", "undefined alias"),
        ("a: " + "x" * 5_000_000, "larger than 2 MB"),
        ("a: " + "1" * 10_000, "not valid YAML"),
        ("? [a]\n: 1\n<<: 3", "not valid YAML"),
    ],
)
@pytest.mark.slow
def test_yaml_of_a_stranger_is_refused(text, said, kind):
    with pytest.raises(InputError, match=said):
        parse_yaml(text, kind=kind)


@pytest.mark.slow
def test_a_file_names_its_line(tmp_path):
    path = tmp_path / "field.yaml"
    path.write_text("a: 1\nb: " + "[" * 300)
    with pytest.raises(InputError, match=r"field.yaml:2: .*100 levels"):
        read_yaml(path)


def test_what_has_no_end_or_is_too_large_is_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/zero")
    for name in ("pipe", "link", "."):
        for read in (read_limited, read_yaml):
            with pytest.raises(InputError, match="not a regular file"):
                read(tmp_path / name)
    (tmp_path / "four").write_bytes(b"four")
    assert read_limited(tmp_path / "four", limit=4) == b"four"
    with pytest.raises(InputError, match="is larger than"):
        read_limited(tmp_path / "four", limit=3)
    for name in ("none", "nu\0ll"):
        with pytest.raises(InputError, match=r"cannot be read: .* -> check it"):
            read_limited(tmp_path / name, "check it")


def test_usual_aliases_are_read_as_ever():
    text = "a: &a {x: 1, y: [2, 3]}\nb: *a\nc:\n  <<: *a\n  z: 4\nd: &a 5\ne: *a\n"
    shared = {"x": 1, "y": [2, 3]}
    assert parse_yaml(text) == {"a": shared, "b": shared, "c": {**shared, "z": 4}, "d": 5, "e": 5}


def test_the_quick_parser_reads_what_is_harmless_and_leaves_the_rest_to_the_other():
    pytest.importorskip("yaml")
    assert read_quickly("a: &x [1, 2.5, on]\nb: *x\n", 100) == {"a": [1, 2.5, True], "b": [1, 2.5, True]}
    assert read_quickly("[1, 2, 3]", 4) == [1, 2, 3]
    assert read_quickly("[1, 2, 3]", 3) is None
    for text in (
        LAUGHS, MERGES, "a: &a [*a]", "a: 1\na: 2", "a: *b", "[" * 100_000, "- " * 300 + "a", "? [a]\n: 1",
        "a: 2026-13-45", "!!bool maybe", "!!int ''", "!!timestamp x", "\0",
    ):  # fmt: skip
        assert read_quickly(text, 100_000) is None


# Sections --------------------------------------------------------------------------------------------------------


class Tube(Section):
    volume_l: float
    gas: str = "helium"


class Logger(Section):
    name: str
    tubes: list[Tube]


def test_every_mistake_has_its_line_and_a_remedy(tmp_path):
    path = tmp_path / "logger.yaml"
    path.write_text("nam: rover\ntubes:\n- volume_l: 2.5\n- volume_l: big\n")
    with pytest.raises(InputError) as caught:
        load_model(path, Logger)
    mistakes = {(mistake.line, mistake.column): mistake for mistake in caught.value.mistakes}
    assert sorted(mistakes) == [(0, "name"), (1, "nam"), (4, "tubes.1.volume_l")]
    assert mistakes[1, "nam"].remedy == "remove it or use one of: name, tubes (did you mean 'name'?)"
    assert "but it is 'big'" in mistakes[4, "tubes.1.volume_l"].message


@pytest.mark.parametrize(("text", "said"), [("", "nothing"), ("- a", "a list"), ("a", "a single value")])
def test_a_file_without_keys_is_refused(tmp_path, text, said):
    path = tmp_path / "logger.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=f"should hold keys and values, but holds {said}"):
        load_model(path, Logger)


class Place(Section):
    latitude_deg: float
    longitude_deg: float


class Journey(Section):
    start: Place
    day: str = ""
    curve: Literal["desilets", "universal"] = "desilets"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("start: [53.2, -0.5]\n", "is [53.2, -0.5] -> write its keys, such as {latitude_deg: ...}"),
        ("start: {latitude_deg: 53 16 4.8 N, longitude_deg: 0}\n", "write degrees with decimals"),
        (
            "start: {latitude_deg: 0, longitude_deg: '0°31\\'28.2\"W'}\n".replace("\\'", "''"),
            "write degrees with decimals",
        ),
        ("start: {latitude_deg: 0, longitude_deg: 0}\ncurve: Desilets\n", "write desilets"),
        ("start: {latlon: 0}\n", "longitude comes first"),
        ("day: a\nday: b\n", 'duplicate key "day" with value "b" (original value: "a") -> remove one of the two'),
    ],
)
def test_values_of_another_form_get_a_remedy_that_fits(tmp_path, text, said):
    path = tmp_path / "journey.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=re.escape(said)):
        load_model(path, Journey)


def test_a_date_without_quotes_is_a_text(tmp_path):
    path = tmp_path / "journey.yaml"
    path.write_text("start: {latitude_deg: 0, longitude_deg: 0}\nday: 2026-05-02\n")
    assert load_model(path, Journey).day == "2026-05-02"


# Plain values ----------------------------------------------------------------------------------------------------


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


# Errors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("word", "meant"), [("pathces", "patches"), ("gyp", "gypsum_transect"), ("st", ""), ("", ""), ("zzz", "")]
)
def test_a_similar_word_or_the_only_one_that_begins_so_is_meant(word, meant):
    known = ["patches", "gypsum_transect", "station_kansas", "strips"]
    assert did_you_mean(word, known) == (f" (did you mean {meant!r}?)" if meant else "")
