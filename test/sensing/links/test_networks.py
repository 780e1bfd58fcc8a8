# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Links accept data from the networks and senders that their address names."""

import socket
from unittest import mock

import pytest
from scripted_server import ScriptedServer, opened, read, read_until, sends

from soilmoist_ros.foundation.errors import Level
from soilmoist_ros.sensing.links import LinkState
from soilmoist_ros.sensing.links.networks import MAX_SENDERS, RECENT_S, Senders, parse_networks
from soilmoist_ros.sensing.links.reconnecting import Retry
from soilmoist_ros.sensing.survey.driver_health import link_health

RETRY = Retry(0.01, 0.05, silence_s=0.2)


@pytest.fixture
def port():
    """A free UDP port."""
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        probe.bind(("0.0.0.0", 0))
        return probe.getsockname()[1]


def send(data, port, sender, to="127.0.0.1"):
    """A datagram from an address of this machine."""
    with socket.socket(type=socket.SOCK_DGRAM) as one:
        one.bind((sender, 0))
        one.sendto(data, (to, port))


def listening(source):
    """The source, bound."""
    assert source.read_line(0.0) is None
    read_until(source, lambda: source.status.connections == 1)


def test_datagrams_of_other_senders_are_dropped_and_counted(port):
    with opened(f"udp://0.0.0.0:{port}?from=127.0.0.2,127.0.5.0/24", RETRY) as source:
        listening(source)
        for sender in ("127.0.0.3", "127.0.0.2", "127.0.0.1", "127.0.5.77"):
            send(f"{sender}\n".encode(), port, sender)
        assert read(source, 2) == [b"127.0.0.2", b"127.0.5.77"]
        status = source.status
        assert (status.n_refused, status.last_refused) == (2, "127.0.0.1")
        assert (status.n_lines, status.n_bytes) == (2, len("127.0.0.2\n127.0.5.77\n"))
        part = link_health("logger link", status)
        assert (part.level, part.values["datagrams refused"]) == (Level.OK, "2")
        assert part.values["senders"] == "127.0.0.2, 127.0.5.77"


def test_a_link_that_is_silent_for_its_list_of_senders_says_so(port):
    with opened(f"udp://127.0.0.1:{port}?from=192.0.2.9", RETRY) as source:
        listening(source)

        def silent():
            send(b"1\n", port, "127.0.0.4")
            return source.status.state is LinkState.SILENT and source.status.n_refused > 2

        read_until(source, silent)
        part = link_health("logger link", source.status)
        assert part.level is Level.ERROR
        assert "datagrams of 127.0.0.4 were refused; compare 'from' in the address" in part.message


def test_lines_of_several_senders_without_a_list_are_a_warning(port):
    with opened(f"udp://127.0.0.1:{port}", RETRY) as source:
        listening(source)
        send(b"1\n", port, "127.0.0.2")
        assert read(source, 1) == [b"1"]
        assert link_health("logger link", source.status).level is Level.OK
        send(b"2\n", port, "127.0.0.3")
        assert read(source, 1) == [b"2"]
        part = link_health("logger link", source.status)
        assert part.level is Level.WARN
        assert f"such as udp://127.0.0.1:{port}?from=127.0.0.2" in part.message


def test_a_listener_at_one_address_does_not_hear_what_is_sent_to_another(port):
    with opened(f"udp://127.0.0.2:{port}", RETRY) as source:
        listening(source)
        send(b"to 1\n", port, "127.0.0.1", to="127.0.0.1")
        send(b"to 2\n", port, "127.0.0.1", to="127.0.0.2")
        assert read(source, 1) == [b"to 2"]
        assert source.status.n_lines == 1


def test_links_by_one_network_interface(port):
    with opened(f"udp://0.0.0.0:{port}?interface=lo", RETRY) as source:
        listening(source)
        send(b"here\n", port, "127.0.0.1")
        assert read(source, 1) == [b"here"]
    with ScriptedServer(sends(b"a\n")) as server, opened(f"{server.uri}?interface=lo") as source:
        assert read(source, 1) == [b"a"]


def test_datagrams_of_another_network_interface_are_not_heard(port):
    others = [name for _, name in socket.if_nameindex() if name != "lo"]
    if not others:
        pytest.skip("this machine has a single network interface")
    with opened(f"udp://0.0.0.0:{port}?interface={others[0]}", RETRY) as source:
        listening(source)
        send(b"by lo\n", port, "127.0.0.1")
        assert source.read_line(0.1) is None
        assert source.status.n_bytes == 0


@pytest.mark.parametrize("kind", ["tcp", "udp"])
def test_an_interface_that_is_missing_is_named_and_awaited(kind, port):
    with opened(f"{kind}://127.0.0.1:{port}?interface=usb7", RETRY) as source:
        read_until(source, lambda: source.status.attempts >= 3)
        assert source.status.state is LinkState.CONNECTING
        assert "there is no network interface 'usb7'; there are: " in source.status.last_error


@pytest.mark.parametrize("index", [OSError("no such interface"), 99])
def test_datagrams_come_again_when_an_adapter_was_unplugged(index, port, monkeypatch):
    with opened(f"udp://0.0.0.0:{port}?interface=lo", RETRY) as source:
        listening(source)
        with monkeypatch.context() as unplugged:
            unplugged.setattr(socket, "if_nametoindex", mock.Mock(side_effect=[index]))
            read_until(source, lambda: source.status.state is LinkState.CONNECTING)
        assert source.status.last_error == "the network interface 'lo' was unplugged"
        read_until(source, lambda: source.status.connections == 2)
        send(b"here\n", port, "127.0.0.1")
        assert read(source, 1) == [b"here"]


def test_senders_that_fall_silent_are_forgotten_and_their_number_is_bounded():
    now_s = [0.0]
    senders = Senders(clock=lambda: now_s[0])
    assert senders.accepts("10.0.0.1")
    now_s[0] = RECENT_S + 1
    assert senders.accepts("10.0.0.2")
    assert senders.recent == ("10.0.0.2",)
    assert all(senders.accepts(f"10.0.1.{number}") for number in range(50))
    assert senders.recent == tuple(f"10.0.1.{number}" for number in range(50 - MAX_SENDERS, 50))


def test_addresses_of_both_versions():
    senders = Senders(parse_networks("192.168.5.20, fe80::/10"))
    assert senders.accepts("::ffff:192.168.5.20")
    assert senders.accepts("fe80::1%eth0")
    assert not senders.accepts("::ffff:192.168.5.21")
    assert not senders.accepts("2001:db8::1")
