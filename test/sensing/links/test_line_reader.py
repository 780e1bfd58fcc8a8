"""A background thread reads lines until it is stopped."""

import threading
import time

from scripted_server import LIMIT_S, QUICK, ScriptedServer, sends

from soilmoist_ros.sensing.links import LinkState, open_source
from soilmoist_ros.sensing.links.line_reader import LineReader


def test_a_reader_returns_the_lines_of_its_thread_and_stops():
    called = []
    with ScriptedServer(sends(b"a\nb\n"), sends(b"c\n")) as server:
        reader = LineReader(open_source(server.uri, QUICK), lambda: called.append(1))
        lines = []
        deadline = time.monotonic() + LIMIT_S
        while len(lines) < 3 and time.monotonic() < deadline:
            lines += reader.take(2)
        reader.stop()
    assert lines == [b"a", b"b", b"c"]
    assert len(called) >= 3
    assert reader.status.state is LinkState.CLOSED
    assert not [thread for thread in threading.enumerate() if thread.name == "line reader"]
