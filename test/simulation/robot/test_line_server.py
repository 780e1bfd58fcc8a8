# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import json
import socket
import time

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.simulation.robot import simulated_links as line_server
from soilmoist_ros.simulation.robot.simulated_links import LineServer, write_ports_file


@pytest.fixture
def server():
    made = LineServer("logger", "127.0.0.1", 0, b"hello\n")
    yield made
    made.close()


def until(server, condition):
    deadline = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < deadline
        server.poll()
        time.sleep(0.001)


def connect(server):
    known = server.clients
    client = socket.create_connection(server.address, timeout=10)
    until(server, lambda: server.clients == known + 1)
    return client


def test_all_clients_receive_the_greeting_and_the_same_bytes(server):
    with connect(server) as early:
        server.send(b"one\n")
        with connect(server) as late:
            server.send(b"two\n")
            assert early.makefile("rb").read(14) == b"hello\none\ntwo\n"
            assert late.makefile("rb").read(10) == b"hello\ntwo\n"


@pytest.mark.parametrize("rude", [False, True])
def test_clients_may_disconnect(server, rude):
    with connect(server) as stays:
        leaves = connect(server)
        leaves.sendall(b"input of a client is ignored\n")
        if rude:  # a reset, as of a process that was killed
            leaves.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
        leaves.close()
        until(server, lambda: server.clients == 1)
        server.send(b"one\n")
        assert stays.makefile("rb").read(10) == b"hello\none\n"


def test_a_client_that_reads_nothing_does_not_block_the_others(server, monkeypatch):
    monkeypatch.setattr(line_server, "LARGEST_BACKLOG", 1000)
    with connect(server) as sleeps:
        with connect(server) as listens:
            stream = listens.makefile("rb")
            assert stream.readline() == b"hello\n"
            line = b"x" * 65535 + b"\n"
            for _ in range(400):  # more than the system buffers
                server.send(line)
                assert stream.readline() == line
                if server.clients == 1:
                    break
            assert server.clients == 1
        assert sleeps.recv(6) == b"hello\n"


def test_a_slow_client_receives_the_remaining_bytes_later(server):
    with connect(server) as slow:
        text = b"".join(b"%07d\n" % number for number in range(100_000))
        server.send(text)
        assert server.clients == 1
        slow.setblocking(False)
        got = bytearray()

        def complete():
            try:
                got.extend(slow.recv(1 << 16))
            except BlockingIOError:
                return False
            return len(got) == len(text) + 6

        until(server, complete)
        assert got[6:] == text


def test_an_unreachable_server_refuses_clients(server):
    before = connect(server)
    server.set_reachable(False)
    with before:
        assert before.makefile("rb").read() == b"hello\n"
    with socket.create_connection(server.address, timeout=10) as refused:
        refused.setblocking(False)

        def ended():
            try:
                return refused.recv(10) == b""
            except BlockingIOError:
                return False

        until(server, ended)
    assert server.clients == 0
    server.set_reachable(True)
    connect(server).close()


def test_a_port_in_use_is_reported(server):
    with pytest.raises(InputError, match=r"the receiver cannot listen on 127.0.0.1:\d+.*or 0 for a free one"):
        LineServer("receiver", *server.address)


def test_the_ports_file_has_the_addresses(server, tmp_path):
    path = tmp_path / "new" / "ports.json"
    write_ports_file({"logger": server.address}, path)
    written = json.loads(path.read_text())["logger"]
    assert (written["host"], written["port"]) == server.address
    assert [file.name for file in path.parent.iterdir()] == ["ports.json"]
