# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Who may see the page and who may steer, and the port of a page."""

from __future__ import annotations

import socket
import sys

import pytest

from soilmoist_ros.console.visitors import (
    ABSENT_S,
    Access,
    Controls,
    Visitor,
    free_port,
    invitation,
    own_certificate,
    tls_context,
)
from soilmoist_ros.foundation.errors import InputError

HERE = {"Host": "127.0.0.1:8050"}
AWAY = {"Host": "192.168.1.5:8050"}


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example:8050"},  # DNS rebinding
        {"Host": ""},
        {"Host": "localhost.evil.example"},
        {"Host": "[broken"},
        {**HERE, "Origin": "http://evil.example"},
        {**HERE, "Origin": "http://127.0.0.1:9999"},
        {**HERE, "Origin": "null"},
        {**HERE, "Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"},
        {**HERE, "Sec-Fetch-Site": "same-site"},
    ],
)
def test_other_sites_are_refused(headers):
    assert Access().refusal(Visitor("127.0.0.1", headers))


def test_addresses_known_names_the_page_itself_and_links_to_it_are_served():
    hosts = ("127.0.0.1:8050", "localhost:8050", "[::1]:8050", "192.168.1.5:8050", "Robot.local")
    for headers in (
        *({"Host": host} for host in hosts),
        {**HERE, "Origin": "http://127.0.0.1:8050", "Sec-Fetch-Site": "same-origin"},
        {**HERE, "Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"},
    ):
        assert Access(("robot.local",)).refusal(Visitor("127.0.0.1", headers)) == ""


@pytest.mark.parametrize(
    ("address", "headers", "may"),
    [
        ("127.0.0.1", HERE, True),
        ("::1", {"Host": "[::1]:80"}, True),
        ("::ffff:127.0.0.1", {"Host": "localhost"}, True),
        ("192.168.1.9", AWAY, False),
        ("192.168.1.9", HERE, False),
        ("127.0.0.1", AWAY, False),
        ("127.0.0.1", {**HERE, "X-Forwarded-For": "10.0.0.1"}, False),  # a proxy on this machine
    ],
)
def test_only_this_machine_steers_without_a_token(address, headers, may):
    assert Access().may_steer(Visitor(address, headers)) is may


def test_a_token_is_good_for_one_visitor_also_if_the_next_one_cannot_be_printed():
    renewed = []

    def closed(token):
        renewed.append(token)
        raise OSError(5, "Input/output error")

    access = Access(renewed=closed)
    first = access.token
    assert access.session("wrong") is None
    assert access.session("wröng") is None
    cookie = access.session(first)
    assert access.may_steer(Visitor("192.168.1.9", AWAY, cookie))
    assert not access.may_steer(Visitor("192.168.1.9", AWAY, "other"))
    assert access.session(first) is None, "it is used up"
    assert renewed == [access.token]
    assert access.session(access.token) not in (None, cookie)


# Who has the controls (controls.py) -----------------------------------------------------------------------------


def test_the_controls_of_a_page_that_is_gone_are_free_after_a_while():
    now = [0.0]
    controls = Controls(lambda: now[0])
    controls.connect("a")
    controls.take("a", "Ada")
    now[0] = 1000.0
    assert not controls.take("b", "Bo")
    controls.disconnect("a")
    now[0] += ABSENT_S - 1
    assert not controls.take("b", "Bo"), "it may be reloading"
    now[0] += 2
    assert controls.who == ""
    assert controls.take("b", "Bo")


# How a phone gets to the page (invitation.py) -------------------------------------------------------------------


def test_the_address_comes_with_a_code_for_phones(monkeypatch):
    text, *code = invitation("http://192.168.1.5:8050/", "abc").splitlines()
    assert "http://192.168.1.5:8050/?token=abc" in text
    assert len([line for line in code if line.strip()]) > 10
    monkeypatch.setitem(sys.modules, "segno", None)
    assert invitation("http://192.168.1.5:8050", "abc").splitlines() == [text]


def test_a_page_takes_another_port_if_the_wanted_one_is_in_use():
    with socket.create_server(("127.0.0.1", 0)) as other:
        taken = other.getsockname()[1]
        with socket.create_server(("127.0.0.1", free_port(taken))) as mine:
            assert mine.getsockname()[1] != taken
        with pytest.raises(InputError, match=f"cannot have port {taken} of 127.0.0.1.*end the program"):
            free_port(taken, strict=True)


def test_a_computer_makes_its_certificate_once_and_a_wrong_one_is_refused(tmp_path):
    made = own_certificate(tmp_path / "own", "192.168.1.5")
    assert made.stat().st_mode & 0o077 == 0, "it has the key"
    content = made.read_bytes()
    assert own_certificate(tmp_path / "own", "10.0.0.1").read_bytes() == content, "browsers know it"
    assert tls_context(made, None).get_ciphers()
    (tmp_path / "no.pem").write_text("no")
    with pytest.raises(InputError, match="no certificate that can be used"):
        tls_context(tmp_path / "no.pem", None)


def test_the_position_is_that_of_the_page_that_had_the_controls_last():
    controls = Controls(lambda: 0.0)
    assert not controls.had_last("a"), "nobody had them"
    controls.take("a", "Ada")
    controls.take("b", "Bo", over=True)
    assert [controls.had_last(client) for client in ("a", "b", "")] == [False, True, False]
