# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How a browser gets to the page: a free port, an address with a token, as text and as a QR code."""

from __future__ import annotations

import contextlib
import io
import socket

from soilmoist_ros.foundation import InputError, optional_module

PORT = 8050
"""Port of a page on this machine, if it is free."""
LOOPBACK = ("127.0.0.1", "::1", "localhost")
_EVERYWHERE = ("0.0.0.0", "::", "")
_ELSEWHERE = ("192.0.2.1", 9)
"""An address that nobody has (RFC 5737): the way there shows this computer's own address, and nothing is sent."""


def free_port(wanted: int) -> int:
    """A port on this machine: the one that is wanted if it is free, else another."""
    for port in (wanted, 0):
        with contextlib.suppress(OSError), socket.create_server(("127.0.0.1", port)) as server:
            return int(server.getsockname()[1])
    raise InputError("no TCP port is free", "end other programs first")


def reachable(host: str) -> str:
    """Host for an address to open; where the console listens on all networks, the address of this computer.

    >>> reachable("127.0.0.1"), reachable("fd00::1")
    ('127.0.0.1', '[fd00::1]')
    """
    if host not in _EVERYWHERE:
        return f"[{host}]" if ":" in host else host
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as way:
            way.connect(_ELSEWHERE)
            return str(way.getsockname()[0])
    except OSError:  # without a network
        return socket.gethostname()


def invitation(page: str, token: str) -> str:
    """Text with the address that lets one browser steer from another machine, and its QR code if possible.

    :param page: address of the page
    """
    address = f"{page.rstrip('/')}/?token={token}"
    text = f"to steer from another machine, open {address} (once)"
    try:
        code = optional_module("segno").make(address, error="l")
    except InputError:
        return text
    picture = io.StringIO()
    code.terminal(out=picture, compact=True)
    return f"{text}\n{picture.getvalue()}"
