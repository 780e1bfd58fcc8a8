# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Addresses of sources."""

import os
import socket
import threading
import time
import tty

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scripted_server import LIMIT_S, QUICK, ScriptedServer, opened, read, read_until, sends

from soilmoist_ros.foundation.errors import InputError, Level
from soilmoist_ros.sensing.connections import Connection, ReconnectingSource, Retry, open_source
from soilmoist_ros.sensing.lines import MAX_WAITING, MAX_WAITING_BYTES, LineBuffer, LineReader, LinkState
from soilmoist_ros.sensing.survey.driver import link_health


@pytest.mark.parametrize(
    ("uri", "said"),
    [
        ("", "has no kind"),
        ("192.168.1.20:5000", "write it like tcp://"),
        ("tpc://host:1", "write it like tcp://192.168.1.20:5000"),
        ("tcp://host", "lacks the port"),
        ("tcp://:5000", "lacks the host"),
        ("tcp://host:99999", "ort out of range"),
        ("tcp://host:5000/x", "has a path"),
        ("tcp://host:5000?baud=9600", "unknown option 'baud'; there is: none"),
        ("tcp://host:5000?=9600", "unknown option ''; there is: none"),
        ("udp://0.0.0.0:5000?form=10.0.0.1", "unknown option 'form'; there is: none"),
        ("udp://0.0.0.0:5000?none=1", "unknown option 'none'; there is: none"),
        ("serial://ttyUSB0", "three slashes"),
        ("serial:///dev/ttyUSB0?baud=fast", "baud='fast' is not a number"),
        ("serial:///dev/ttyUSB0?baud=9", "at least 50"),
        ("file:///tmp/survey.log?speed=10", "map a log with 'soilmoist map LOG'"),
    ],
)
def test_a_bad_address_is_refused_with_an_example(uri, said):
    with pytest.raises(InputError) as caught:
        open_source(uri)
    assert said in str(caught.value)


@pytest.mark.parametrize("uri", ["tcp://127.0.0.1:5000?interface=eth0", "udp://127.0.0.1:5000?from=10.0.0.1"])
def test_options_of_earlier_releases_are_ignored_with_a_warning(uri, caplog):
    for _ in range(2):
        open_source(uri)
    (said,) = caplog.messages
    assert "is not used any more: a udp address takes the lines of one sender, and a firewall" in said


# Reconnecting ----------------------------------------------------------------------------------------------------

RETRY = Retry(0.01, 0.05, silence_s=0.2)


@pytest.fixture
def port():
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        probe.bind(("0.0.0.0", 0))
        return probe.getsockname()[1]


def test_it_reconnects_after_the_server_has_closed_and_drops_the_incomplete_line():
    with ScriptedServer(sends(b"a\ncut"), sends(b"b\n"), sends(b"c\n")) as server, opened(server.uri) as source:
        assert read(source, 3) == [b"a", b"b", b"c"]
        assert source.status.connections == 3
        assert "closed the connection" in source.status.last_error


@pytest.mark.slow
def test_a_half_open_connection_is_replaced_after_the_silence_limit():
    hung = threading.Event()

    def hang(client):
        client.sendall(b"a\n")
        hung.wait(LIMIT_S)

    retry = Retry(0.01, 0.05, silence_s=1.0)
    with ScriptedServer(hang, sends(b"b\n")) as server, opened(server.uri, retry) as source:
        assert read(source, 1) == [b"a"]
        read_until(source, lambda: "no bytes for" in source.status.last_error)
        assert source.status.state is LinkState.SILENT
        hung.set()
        assert read(source, 1) == [b"b"]


def test_a_line_of_a_megabyte_without_an_end_is_noise_within_bounded_memory():
    noise = b"x" * 1_000_000
    with ScriptedServer(sends(b"a\n", noise, b"tail\nb\n")) as server, opened(server.uri) as source:
        assert read(source, 2) == [b"a", b"b"]
        status = source.status
        assert (status.n_oversized, status.n_lines) == (1, 2)
        assert status.n_bytes == 1_000_000 + len(b"a\ntail\nb\n")


def test_refused_connections_and_unknown_names_are_reported_and_retried():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with opened(f"tcp://127.0.0.1:{port}") as source:
        read_until(source, lambda: source.status.attempts >= 3)
        assert source.status.state is LinkState.CONNECTING
        assert "refused" in source.status.last_error.lower()
    with opened("tcp://no-such-host.invalid:5000") as source:
        read_until(source, lambda: source.status.attempts >= 1)
        assert source.status.last_error


@given(st.integers(1, 10_000))
def test_pauses_grow_but_are_bounded(attempts):
    pause_s = Retry(first_s=0.5, max_s=15.0).pause_s(attempts)
    full_s = min(15.0, 0.5 * 2.0 ** min(attempts - 1, 20))
    assert full_s / 2 <= pause_s <= full_s


def test_datagrams_are_lines_with_or_without_their_ends(port):
    with opened(f"udp://127.0.0.1:{port}", RETRY) as source, socket.socket(type=socket.SOCK_DGRAM) as sender:
        listening(source)
        for datagram in (b"one\r\ntwo", b"three\n", b"", b"four"):
            sender.sendto(datagram, ("127.0.0.1", port))
        assert read(source, 4) == [b"one", b"two", b"three", b"four"]
        read_until(source, lambda: source.status.state is LinkState.SILENT)
        assert source.status.connections == 1  # silence of a sender is no reason to bind again
        sender.sendto(b"five", ("127.0.0.1", port))
        assert read(source, 1) == [b"five"]
        assert source.status.state is LinkState.CONNECTED


def test_a_serial_port_that_is_pulled_out_and_put_back(tmp_path):
    def plug():
        master, slave = os.openpty()
        tty.setraw(slave)
        device.unlink(missing_ok=True)
        device.symlink_to(os.ttyname(slave))
        return master, slave

    device = tmp_path / "ttyUSB0"
    with opened(f"serial://{device}?baud=9600") as source:
        read_until(source, lambda: source.status.attempts >= 2)
        assert "ttyUSB0" in source.status.last_error
        master, slave = plug()
        read_until(source, lambda: source.status.state is LinkState.CONNECTED)
        os.write(master, b"one\r\ntw")
        os.write(master, b"o\r\n")
        assert read(source, 2) == [b"one", b"two"]
        os.close(slave)
        os.close(master)
        read_until(source, lambda: source.status.state is LinkState.CONNECTING)
        master, slave = plug()
        read_until(source, lambda: source.status.state is LinkState.CONNECTED)
        os.write(master, b"three\n")
        assert read(source, 1) == [b"three"]
        os.close(slave)
        os.close(master)


# Networks --------------------------------------------------------------------------------------------------------


def send(data, port, sender):
    with socket.socket(type=socket.SOCK_DGRAM) as one:
        one.bind((sender, 0))
        one.sendto(data, ("127.0.0.1", port))


def listening(source):
    assert source.read_line(0.0) is None
    read_until(source, lambda: source.status.connections == 1)


def test_closing_a_device_that_is_gone_is_no_error():
    def close():
        raise OSError("Input/output error")

    source = ReconnectingSource("serial:///dev/ttyUSB0", lambda: Connection(lambda timeout_s: b"a\n", close))
    assert source.read_line(LIMIT_S) == b"a"
    source.close()

    def connect():
        late.close()
        return Connection(lambda timeout_s: b"a\n", close)

    late = ReconnectingSource("serial:///dev/ttyUSB0", connect)
    assert late.read_line(LIMIT_S) is None


def test_lines_of_a_second_sender_are_dropped_with_a_warning_until_the_first_is_silent(port, monkeypatch):
    with opened(f"udp://0.0.0.0:{port}", RETRY) as source:
        listening(source)
        for sender in ("127.0.0.2", "127.0.0.3", "127.0.0.2"):
            send(f"{sender}\n".encode(), port, sender)
        assert read(source, 2) == [b"127.0.0.2"] * 2
        status = source.status
        assert (status.sender, status.n_refused, status.refused, status.n_lines) == (
            "127.0.0.2",
            1,
            "127.0.0.3",
            2,
        )
        part = link_health("logger link", status)
        assert (part.level, part.values["datagrams refused"]) == (Level.WARN, "1")
        assert "lines of 127.0.0.2 are used, those of 127.0.0.3 dropped; give one another port" in part.message
        monkeypatch.setattr("soilmoist_ros.sensing.connections.RECENT_S", 0.0)
        send(b"new\n", port, "127.0.0.3")
        assert read(source, 1) == [b"new"]
        assert link_health("logger link", source.status).level is Level.OK


def test_a_port_that_another_program_uses_is_refused_before_the_start(port):
    link = f"/dev/pts/{os.ttyname(one := os.openpty()[1]).rsplit('/', 1)[1]}"
    tty.setraw(one)
    for uri in (f"udp://127.0.0.1:{port}", f"serial://{link}"):
        source = open_source(uri)
        source.refuse_taken()
        source.read_line(0.05)
        with pytest.raises(InputError, match=r"cannot be used: .* -> end the other program"):
            open_source(uri).refuse_taken()
        source.close()
    open_source("tcp://127.0.0.1:1").refuse_taken()


# Lines: bytes in pieces of any size become whole lines (lines.py) ------------------------------------------------


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
