# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Who may see the page, and who may steer: by address, name of the host, origin, and token."""

from __future__ import annotations

import contextlib
import hmac
import ipaddress
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final
from urllib.parse import SplitResult, urlsplit

from soilmoist_ros.foundation import InputError

COOKIE: Final = "soilmoist_console"
_PROXY: Final = ("Forwarded", "X-Forwarded-For", "X-Forwarded-Host", "X-Real-Ip", "Via")


@dataclass(frozen=True)
class Visitor:
    """Who sent a request.

    :param address: address of the other end of the connection
    :param headers: headers of the request; names in any case
    :param cookie: value of :data:`COOKIE`, empty without one
    """

    address: str
    headers: Mapping[str, str]
    cookie: str = ""


class Access:
    """Decides about visitors. Only the thread of the server uses it.

    A page of another site may send requests from the visitor's browser, or give its name the address of this
    machine (DNS rebinding). The first is refused by the origin, the second by the name of the host.

    :param names: names under which the page is reached, besides addresses and ``localhost``
    :param renewed: called with each token that replaces a used one; may fail as files do
    :param public: address of the page behind a proxy, empty without one; then nobody steers without a token, since
        a proxy on this machine makes all visitors look like visitors from here
    :raises InputError: if ``public`` is no address of a page
    """

    def __init__(
        self,
        names: tuple[str, ...] = (),
        renewed: Callable[[str], None] = lambda token: None,
        public: str = "",
    ) -> None:
        self._public = _page_address(public)
        self.is_proxied = bool(self._public.netloc)
        """Whether visitors come through a proxy, whose address is then that of all."""
        self._names = {name.lower().rstrip(".") for name in (*names, self._public.hostname or "") if name}
        self.secure = self._public.scheme == "https"
        """Whether browsers shall send the cookie over TLS only."""
        self._renewed = renewed
        self._sessions: set[str] = set()
        self.token = secrets.token_urlsafe(16)
        """Lets one visitor steer."""

    def refusal(self, visitor: Visitor) -> str:
        """Why a request is not answered at all; empty if it is."""
        host = visitor.headers.get("Host", "")
        name = _host_name(host)
        if not (name == "localhost" or _address(name) or name in self._names):
            return (
                f"the page is not served as {name or 'a host without a name'}: add the name to the parameter names"
            )
        origin = visitor.headers.get("Origin")
        if origin is not None and not self._is_own(origin, host):
            return "the request came from a page of another site"
        followed = visitor.headers.get("Sec-Fetch-Mode") == "navigate"  # a link to the page is harmless
        if visitor.headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none") and not followed:
            return "the request came from a page of another site"
        return ""

    def _is_own(self, origin: str, host: str) -> bool:
        """Whether a page of an origin is the one that this host serves."""
        parts = urlsplit(origin)
        plain = self.secure and parts.hostname == self._public.hostname and parts.scheme != "https"
        return parts.netloc.lower() == host.lower() and not plain

    def may_steer(self, visitor: Visitor) -> bool:
        """Whether somebody at this machine, or with a token, sent it; to others the page is read-only."""
        host = _host_name(visitor.headers.get("Host", ""))
        forwarded = any(visitor.headers.get(name) is not None for name in _PROXY)
        from_here = _loopback(visitor.address) and (host == "localhost" or _loopback(host))
        here = from_here and not forwarded and not self.is_proxied
        return here or any(
            hmac.compare_digest(visitor.cookie.encode(), session.encode()) for session in self._sessions
        )

    def session(self, token: str) -> str | None:
        """Value of the cookie for a visitor who has the token, which is then used up; ``None`` for a wrong one."""
        if not hmac.compare_digest(token.encode(), self.token.encode()):
            return None
        session = secrets.token_urlsafe(24)
        self._sessions.add(session)
        self.token = secrets.token_urlsafe(16)
        with contextlib.suppress(OSError):  # the next token cannot be shown: this visitor may steer all the same
            self._renewed(self.token)
        return session


def _page_address(public: str) -> SplitResult:
    """Parts of the address of a page.

    :raises InputError: if it is none
    """
    try:
        parts = urlsplit(public)
        wrong = bool(public) and (parts.scheme not in ("http", "https") or not parts.hostname or bool(parts.query))
    except ValueError:
        wrong = True
    if wrong:
        raise InputError(
            f"{public!r} is no address of a page", "set address to one such as https://robot.example/"
        )
    return parts


def _host_name(host: str) -> str:
    """Host of a ``Host`` header, without port and brackets, lower case."""
    try:
        return (urlsplit(f"//{host}").hostname or "").rstrip(".")
    except ValueError:
        return ""


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(name)
    except ValueError:
        return None


def _loopback(name: str) -> bool:
    address = _address(name)
    if address is None:
        return False
    mapped = getattr(address, "ipv4_mapped", None)
    return (mapped or address).is_loopback
