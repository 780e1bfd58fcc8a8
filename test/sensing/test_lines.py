# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bytes in pieces of any size become whole lines (lines.py)."""

import threading
import time

from hypothesis import given
from hypothesis import strategies as st
from scripted_server import LIMIT_S, QUICK, ScriptedServer, sends

from soilmoist_ros.sensing.connections import open_source
from soilmoist_ros.sensing.lines import MAX_WAITING, MAX_WAITING_BYTES, LineBuffer, LineReader, LinkState


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


# Line reader -----------------------------------------------------------------------------------------------------


def test_a_reader_returns_the_lines_of_its_thread_and_stops():
    called = []
    with ScriptedServer(sends(b"a\nb\n"), sends(b"c\n")) as server:
        reader = LineReader(open_source(server.uri, QUICK), lambda: called.append(1))
        lines = []
        deadline = time.monotonic() + LIMIT_S
        while len(lines) < 3 and time.monotonic() < deadline:
            lines += reader.take(2)
        reader.stop()
    assert lines[:3] == [b"a", b"b", b"c"]  # the server repeats its last script
    assert len(called) >= 3
    assert reader.status.state is LinkState.CLOSED
    assert not [thread for thread in threading.enumerate() if thread.name == "line reader"]


def test_lines_that_wait_are_limited_in_their_size():
    class Flood:
        def __init__(self):
            self.read = 0

        def read_line(self, timeout_s):
            self.read += 1
            return b"x" * 65_536

        def close(self):
            pass

    flood = Flood()
    reader = LineReader(flood, lambda: None)
    deadline = time.monotonic() + LIMIT_S
    while flood.read <= MAX_WAITING_BYTES // 65_536 and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.05)  # it waits now, and goes on when lines are taken
    assert flood.read == MAX_WAITING_BYTES // 65_536 + 1
    taken = reader.take(MAX_WAITING)
    assert sum(map(len, taken)) == MAX_WAITING_BYTES
    while flood.read < 2 * len(taken) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert flood.read >= 2 * len(taken)
    reader.stop()
