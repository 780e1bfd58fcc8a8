# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A server with the behaviour of servers in the field, and readers of its lines."""

from __future__ import annotations

import contextlib
import socket
import threading
import time

from soilmoist_ros.sensing.connections import Retry, open_source

LIMIT_S = 20.0
QUICK = Retry(first_s=0.01, max_s=0.05, silence_s=30.0)


class ScriptedServer:
    """A TCP server; the n-th client gets the n-th script, a function of its socket. The last one repeats."""

    def __init__(self, *scripts):
        self.scripts = scripts
        self.clients = 0
        self.done = threading.Event()
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.settimeout(0.1)
        self.uri = f"tcp://127.0.0.1:{self._server.getsockname()[1]}"
        self._thread = threading.Thread(target=self._run)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self.done.set()
        self._thread.join(LIMIT_S)
        self._server.close()

    def _run(self):
        while not self.done.is_set():
            try:
                client, _ = self._server.accept()
            except TimeoutError:
                continue
            script = self.scripts[min(self.clients, len(self.scripts) - 1)]
            self.clients += 1
            with client, contextlib.suppress(OSError):
                script(client)


def read(source, number):
    lines = []
    deadline = time.monotonic() + LIMIT_S
    while len(lines) < number and time.monotonic() < deadline:
        line = source.read_line(0.1)
        if line is not None:
            lines.append(line)
    assert len(lines) == number, source.status
    return lines


def read_until(source, condition):
    deadline = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < deadline, source.status
        source.read_line(0.05)


@contextlib.contextmanager
def opened(uri, retry=QUICK):
    source = open_source(uri, retry)
    try:
        yield source
    finally:
        source.close()


def sends(*pieces):
    def script(client):
        for piece in pieces:
            client.sendall(piece)

    return script
