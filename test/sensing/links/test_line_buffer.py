# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bytes in pieces of any size become whole lines."""

from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.sensing.lines import LineBuffer


@given(st.lists(st.binary(max_size=12)), st.data())
def test_lines_do_not_depend_on_how_the_bytes_are_cut(parts, data):
    text = b"\n".join(parts)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(text)), max_size=8)))
    buffer = LineBuffer()
    for start, end in zip([0, *cuts], [*cuts, len(text)], strict=True):
        buffer.feed(text[start:end])
    buffer.end_line()
    assert list(iter(buffer.pop, None)) == [line for line in text.splitlines() if line]


@given(st.integers(0, 40), st.integers(0, 40))
def test_a_line_that_is_too_long_is_dropped_and_the_next_one_is_not(length, chunk):
    buffer = LineBuffer(max_line=20)
    text = b"x" * length + b"\nnext\n"
    for start in range(0, len(text), chunk + 1):
        buffer.feed(text[start : start + chunk + 1])
    found = list(iter(buffer.pop, None))
    assert found == ([b"x" * length] if 0 < length <= 20 else []) + [b"next"]
    assert buffer.n_oversized == (length > 20)
