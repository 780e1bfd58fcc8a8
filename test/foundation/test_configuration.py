# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""YAML of strangers: what would take minutes, gigabytes or the stack is refused with a reason."""

import os

import pytest

from soilmoist_ros.foundation.configuration import parse_yaml, read_limited, read_quickly, read_yaml
from soilmoist_ros.foundation.errors import InputError

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
        ("[" * 3000, "100 levels"),
        ("[" * 3000 + "]" * 3000, "100 levels"),
        ("{a: " * 3000 + "}" * 3000, "100 levels"),
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
    path.write_text("a: 1\nb: " + "[" * 3000)
    with pytest.raises(InputError, match=r"field.yaml:2: .*100 levels"):
        read_yaml(path)
    path.write_text("x" * 5_000_000)
    with pytest.raises(InputError, match="larger than 2 MB"):
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
