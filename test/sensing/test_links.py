"""Links: a scripted server that does what servers in the field do."""

from __future__ import annotations

import contextlib
import itertools
import os
import random
import socket
import threading
import time
import tty

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.links import LinkState, open_source
from soilmoist_ros.sensing.links.line_buffer import LineBuffer
from soilmoist_ros.sensing.links.line_reader import LineReader
from soilmoist_ros.sensing.links.reconnecting import ReconnectingSource, Retry
from soilmoist_ros.sensing.links.recording import PlaybackClock, RecordingSource

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


def test_split_packets_slow_drip_and_several_lines_at_once():
    drip = [bytes([byte]) for byte in b"one\r\ntw"]
    with ScriptedServer(sends(*drip, b"o\nthr", b"ee\nfour\nfive\n")) as server, opened(server.uri) as source:
        assert read(source, 5) == [b"one", b"two", b"three", b"four", b"five"]


def test_it_comes_back_after_the_server_has_closed_and_drops_what_was_cut():
    with ScriptedServer(sends(b"a\ncut"), sends(b"b\n"), sends(b"c\n")) as server, opened(server.uri) as source:
        assert read(source, 3) == [b"a", b"b", b"c"]
        assert source.status.connections == 3
        assert "closed the connection" in source.status.last_error


@pytest.mark.slow
def test_a_half_open_connection_is_made_anew_after_the_silence_limit():
    hung = threading.Event()

    def hang(client):
        client.sendall(b"a\n")
        hung.wait(LIMIT_S)

    retry = Retry(0.01, 0.05, silence_s=0.3)
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


def test_any_byte_may_come():
    garbage = bytes(byte for byte in range(256) if byte not in b"\r\n")
    with ScriptedServer(sends(garbage, b"\n\n\r\n", b"\x00\n")) as server, opened(server.uri) as source:
        assert read(source, 2) == [garbage, b"\x00"]


@pytest.mark.slow
def test_a_server_that_hangs_up_at_once_is_asked_ever_more_rarely():
    with ScriptedServer(lambda client: None) as server, opened(server.uri, Retry(0.1, 60.0)) as source:
        read_until(source, lambda: source.status.attempts == 4)
        started = time.process_time()
        assert source.read_line(0.1) is None
        assert source.status.attempts == 4  # the next pause is at least 0.4 s
        assert time.process_time() - started < 0.08  # it waits, it does not spin
        assert server.clients <= 4


def test_refused_connections_and_unknown_names_are_told_and_tried_again():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with opened(f"tcp://127.0.0.1:{port}") as source:
        read_until(source, lambda: source.status.attempts >= 3)
        assert source.status.state is LinkState.CONNECTING
        assert "refused" in source.status.last_error.lower()
    with opened("tcp://no-such-host.invalid:5000") as source:
        read_until(source, lambda: source.status.attempts >= 1)
        assert source.status.last_error


@pytest.mark.slow
def test_it_connects_when_the_server_comes_late():
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = server.getsockname()
    with opened(f"tcp://127.0.0.1:{address[1]}") as source:
        read_until(source, lambda: source.status.attempts >= 2)
        with socket.create_server(address) as server:
            server.settimeout(LIMIT_S)
            assert source.read_line(0.5) is None
            client, _ = server.accept()
            with client:
                client.sendall(b"late\n")
                assert read(source, 1) == [b"late"]
        assert source.status.attempts == 0


@given(st.integers(1, 10_000), st.integers())
def test_pauses_grow_but_are_bounded(attempts, seed):
    retry = Retry(first_s=0.5, max_s=15.0)
    pause_s = retry.pause_s(attempts, random.Random(seed))
    full_s = min(15.0, 0.5 * 2.0 ** min(attempts - 1, 20))
    assert full_s / 2 <= pause_s <= full_s


def test_the_next_attempt_waits_for_its_pause():
    ticks = itertools.count()
    attempts = []

    def clock():
        return next(ticks) * 0.25

    def connect():
        attempts.append(clock())
        raise ConnectionRefusedError("refused")

    source = ReconnectingSource("x", connect, Retry(1.0, 8.0), clock, random.Random(1))
    while len(attempts) < 12:
        assert source.read_line(0.251) is None
    pauses = [after - before for before, after in itertools.pairwise(attempts)]
    assert all(0.5 <= pause <= 9.5 for pause in pauses)
    assert pauses[0] <= 2.5
    assert min(pauses[3:]) >= 4.0


def test_datagrams_are_lines_with_or_without_their_ends():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    retry = Retry(0.01, 0.05, silence_s=0.2)
    with opened(f"udp://127.0.0.1:{port}", retry) as source, socket.socket(type=socket.SOCK_DGRAM) as sender:
        assert source.read_line(0.0) is None
        read_until(source, lambda: source.status.connections == 1)
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


def test_a_file_as_fast_as_possible_and_then_it_has_ended(tmp_path):
    path = tmp_path / "a log.txt"
    path.write_bytes(b"one\r\ntwo\nthree")
    with opened(f"{path.as_uri()}?speed=0") as source:
        assert read(source, 3) == [b"one", b"two", b"three"]
        assert source.status.state is LinkState.ENDED
        assert source.read_line(0.0) is None


def test_recordings_that_share_a_clock_stay_in_step_at_any_speed(tmp_path):
    now = [100.0]
    playback = PlaybackClock(lambda: now[0])
    sources = {}
    for name, text in (("a", b"0\nheader\n4\n6\n"), ("b", b"2\n5\n")):
        (tmp_path / name).write_bytes(text)
        stamp_of = lambda line: float(line) if line.isdigit() else None  # noqa: E731
        sources[name] = RecordingSource(tmp_path / name, 2.0, stamp_of, playback)
    played = []
    while len(played) < 6:
        for name in ("a", "b", "a", "b"):
            while (line := sources[name].read_line(0.0)) is not None:
                played.append((now[0] - 100.0, name, line))
        now[0] += 0.5
    assert played == [
        (0.0, "a", b"0"), (0.0, "a", b"header"), (1.0, "b", b"2"),
        (2.0, "a", b"4"), (2.5, "b", b"5"), (3.0, "a", b"6"),
    ]  # fmt: skip


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
        ("tcp://host:5000?baud=9600", "unknown option 'baud'; there are none"),
        ("serial://ttyUSB0", "three slashes"),
        ("serial:///dev/ttyUSB0?baud=fast", "baud='fast' is not a number"),
        ("file:///no/such/file", "no such file"),
        ("file://log.txt", "write it like file:///"),
        ("file:///tmp/x?speed=-1", "at least 0"),
    ],
)
def test_a_bad_address_is_told_with_an_example(uri, said):
    with pytest.raises(InputError) as caught:
        open_source(uri)
    assert said in str(caught.value)


def test_a_reader_hands_over_lines_from_its_thread_and_stops():
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
