# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Faulty connections and the server of their lines: simulated_links.py."""

import json
import socket
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing import FORMAT_NAME, TUBES, Kind, LoggerRecord, format_record
from soilmoist_ros.sensing.formats.logger_reader import RecordParser
from soilmoist_ros.simulation import LineServer, Reachable, Sent, write_ports_file
from soilmoist_ros.simulation.robot import simulated_links as line_server
from soilmoist_ros.simulation.robot.scenario import LinkFaults
from soilmoist_ros.simulation.robot.simulated_links import FaultyLink

PERIOD_S = 10.0


def line(number):
    counts = (float(number),) * TUBES
    return format_record(
        LoggerRecord(
            1.7e9 + PERIOD_S * number, counts, (PERIOD_S,) * TUBES, 1000.0, 15.0, 0.5, record_number=number
        )
    )


def outputs(messages=10, **faults):
    """Output of a link that sends a record every 10 s, with arrival times."""
    link = FaultyLink("logger", LinkFaults.model_validate(faults), np.random.default_rng(1))
    found, time_s = [], 0.0
    for number in range(1, messages + 1):
        while link.next_s <= PERIOD_S * number:
            time_s = link.next_s
            found += [(time_s, output) for output in link.receive(time_s)]
        link.send(PERIOD_S * number, [line(number)])
        found += [(PERIOD_S * number, output) for output in link.receive(PERIOD_S * number)]
    while link.next_s < np.inf:
        time_s = link.next_s
        found += [(time_s, output) for output in link.receive(time_s)]
    return found


def read(found):
    parser = RecordParser(FORMAT_NAME)
    stream = b"".join(output.data for _, output in found if isinstance(output, Sent))
    records = [parser.feed(piece) for piece in stream.splitlines(keepends=True)]
    return [record.record_number for record in records if record], {problem.kind for problem in parser.problems}


DAMAGES = [
    ("missing", [4], {Kind.GAP}),
    ("twice", [], {Kind.DUPLICATE}),
    ("wrong_checksum", [4], {Kind.CHECKSUM, Kind.GAP}),
    ("no_checksum", [4], {Kind.CHECKSUM, Kind.GAP}),
    ("cut_short", [4], {Kind.FOREIGN_TEXT, Kind.GAP}),
    ("split", [], set()),
    ("garbage", [], {Kind.CHECKSUM}),
]


@pytest.mark.parametrize(("kind", "lost", "noticed"), DAMAGES)
def test_damages_lose_the_expected_records_and_never_invent_one(kind, lost, noticed):
    numbers, problems = read(outputs(damages=[{"kind": kind, "nth": 4}]))
    assert numbers == [number for number in range(1, 11) if number not in lost]
    assert problems == noticed


ALL = list(range(1, 11))


@pytest.mark.parametrize(
    ("kind", "turns", "arrivals_s", "numbers"),
    [
        ("cut", [(25, False), (45, True)], [10, 20, *range(50, 101, 10)], [1, 2, *ALL[4:]]),
        ("silence", [], [10, 20, *range(50, 101, 10)], [1, 2, *ALL[4:]]),
        ("stall", [], [10, 20, 45, 45, *range(50, 101, 10)], ALL),
    ],
)
def test_outages_close_the_link_lose_messages_or_delay_them(kind, turns, arrivals_s, numbers):
    found = outputs(outages=[{"kind": kind, "at_s": 25, "for_s": 20}])
    assert [(time_s, one.reachable) for time_s, one in found if isinstance(one, Reachable)] == turns
    assert [time_s for time_s, one in found if isinstance(one, Sent)] == arrivals_s
    assert read(found) == (numbers, {Kind.GAP} if numbers != ALL else set())


def test_what_a_stall_holds_back_is_lost_by_a_cut():
    found = outputs(
        outages=[{"kind": kind, "at_s": at_s, "for_s": 20} for kind, at_s in (("stall", 15), ("cut", 25))]
    )
    assert read(found)[0] == [1, *ALL[4:]]


span = st.fixed_dictionaries({"at_s": st.integers(0, 120), "for_s": st.integers(1, 60)})
outage = st.tuples(span, st.sampled_from(["cut", "silence", "stall"])).map(lambda o: {**o[0], "kind": o[1]})
damage = st.fixed_dictionaries({"nth": st.integers(1, 10), "kind": st.sampled_from([row[0] for row in DAMAGES])})


@pytest.mark.slow
@given(st.lists(outage, max_size=4), st.lists(damage, max_size=5))
def test_faults_keep_time_and_records_in_order(outages, damages):
    found = outputs(outages=outages, damages=damages)
    times = [time_s for time_s, _ in found]
    assert times == sorted(times)
    turns = [output.reachable for _, output in found if isinstance(output, Reachable)]
    assert turns == [bool(number % 2) for number in range(len(turns))]
    assert not turns or turns[-1]
    numbers, _ = read(found)
    assert numbers == sorted(set(numbers))


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
