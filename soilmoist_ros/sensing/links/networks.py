# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From which networks and senders a link accepts data."""

from __future__ import annotations

import ipaddress
import socket
import time
from collections.abc import Callable, Sequence

Network = ipaddress.IPv4Network | ipaddress.IPv6Network
MAX_SENDERS = 8
"""Senders that are remembered by their address."""
RECENT_S = 60.0
"""Time after which a sender that has fallen silent is no longer shown [s]."""


class Senders:
    """Judges senders of datagrams, and counts those that are refused.

    :param allowed: networks whose senders are accepted; all if empty
    :param clock: monotonic time [s]
    """

    def __init__(self, allowed: Sequence[Network] = (), clock: Callable[[], float] = time.monotonic) -> None:
        self.allowed = tuple(allowed)
        self.n_refused = 0
        self.last_refused = ""
        self._clock = clock
        self._heard_s: dict[str, float] = {}

    @property
    def recent(self) -> tuple[str, ...]:
        """Addresses of the last few senders whose datagrams were accepted in the last minute."""
        now_s = self._clock()
        return tuple(sender for sender, at_s in self._heard_s.copy().items() if now_s - at_s <= RECENT_S)

    def accepts(self, sender: str) -> bool:
        """Whether a datagram is accepted.

        :param sender: numeric address
        """
        known = self._heard_s.pop(sender, None) is not None
        if not known and self.allowed and not self._is_allowed(sender):
            self.n_refused += 1
            self.last_refused = sender
            return False
        if len(self._heard_s) >= MAX_SENDERS:
            del self._heard_s[next(iter(self._heard_s))]
        self._heard_s[sender] = self._clock()
        return True

    def _is_allowed(self, sender: str) -> bool:
        address = ipaddress.ip_address(sender.partition("%")[0])
        if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped is not None:
            address = address.ipv4_mapped
        return any(address in network for network in self.allowed)


def parse_networks(text: str) -> tuple[Network, ...]:
    """Addresses and networks, separated by commas.

    >>> [str(network) for network in parse_networks("192.168.5.20,10.0.0.0/8")]
    ['192.168.5.20/32', '10.0.0.0/8']

    :raises ValueError: if one is neither, or there is none
    """
    return tuple(ipaddress.ip_network(part.strip()) for part in text.split(","))


def bind_to_interface(link: socket.socket, interface: str) -> int:
    """Let a socket send and receive by one network interface only.

    :param link: a socket that is neither bound nor connected
    :param interface: name, such as ``eth1``; empty for all
    :return: index of the interface, zero for all
    :raises OSError: if there is no such interface, or the system does not permit it
    """
    if not interface:
        return 0
    known = {name: index for index, name in socket.if_nameindex()}
    if interface not in known:
        raise OSError(f"there is no network interface {interface!r}; there are: {', '.join(known)}")
    link.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface.encode() + b"\0")
    return known[interface]


def is_same_interface(interface: str, index: int) -> bool:
    """Whether an interface is there and not another one: an adapter that was unplugged gets another index."""
    try:
        return socket.if_nametoindex(interface) == index
    except OSError:
        return False
