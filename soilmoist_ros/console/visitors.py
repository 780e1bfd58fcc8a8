# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Visitors: who may see the page and steer it, who has the controls, requests, invitations."""

from __future__ import annotations

import contextlib
import hmac
import io
import ipaddress
import secrets
import socket
import ssl
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from soilmoist_ros.exploration import OperatorRequest
from soilmoist_ros.foundation import InputError, finite_number, foreign_text, optional_module

COOKIE: Final = "soilmoist_console"
_PROXY: Final = ("Forwarded", "X-Forwarded-For", "X-Forwarded-Host", "X-Real-Ip", "Via")
ABSENT_S = 30.0
"""Time without a connection after which the controls are free [s]; the robots go on."""
PORT = 8050
"""Port of a page on this machine, if it is free."""
LOOPBACK = ("127.0.0.1", "::1", "localhost")
_EVERYWHERE = ("0.0.0.0", "::", "")
_ELSEWHERE = ("192.0.2.1", 9)
"""An address that nobody has (RFC 5737): the way there shows this computer's own address, and nothing is sent."""
MAX_TEXT: Final = 200
MAX_ITEMS: Final = 500
_NUMBERS: Final = ("place", "geographic_place")
_TEXTS: Final = ("verb", "who", "dwell", "strategy", "target", "home", "field")
_NAMES: Final = ("stops", "earlier")
_NUMBER: Final = ("hours", "until_sd", "until_gain")
_OF_THE_PAGE: Final = frozenset({"robot", "client"})
_KNOWN: Final = frozenset(field.name for field in fields(OperatorRequest) if field.name != "covariates")
"""Parts of a request that a page may give; covariates are paths of this computer."""


@dataclass(frozen=True)
class Visitor:
    """Sender of a request: address of the other end, headers (names in any case), value of :data:`COOKIE`."""

    address: str
    headers: Mapping[str, str]
    cookie: str = ""


class Access:
    """Decides about visitors. Only the thread of the server uses it.

    A page of another site may send requests from the visitor's browser, or give its name the address of this
    machine (DNS rebinding). The first is refused by the origin, the second by the name of the host.

    :param names: names under which the page is reached, besides addresses and ``localhost``
    :param renewed: called with each token that replaces a used one; may fail as files do
    """

    def __init__(self, names: tuple[str, ...] = (), renewed: Callable[[str], None] = lambda token: None) -> None:
        self._names = {name.lower().rstrip(".") for name in names}
        self.secure = False
        """True if browsers shall send the cookie over TLS only."""
        self._renewed = renewed
        self._sessions: set[str] = set()
        self.token = secrets.token_urlsafe(16)
        """Lets one visitor steer."""

    def refusal(self, visitor: Visitor) -> str:
        """Reason why a request is not answered at all; empty if it is."""
        host = visitor.headers.get("Host", "")
        name = _host_name(host)
        if not (name == "localhost" or _address(name) or name in self._names):
            return (
                f"the page is not served as {name or 'a host without a name'}: add the name to the parameter names"
            )
        origin = visitor.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            return "the request came from a page of another site"
        followed = visitor.headers.get("Sec-Fetch-Mode") == "navigate"  # a link to the page is harmless
        if visitor.headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none") and not followed:
            return "the request came from a page of another site"
        return ""

    def may_steer(self, visitor: Visitor) -> bool:
        """True if somebody at this machine, or with a token, sent it; to others the page is read-only."""
        host = _host_name(visitor.headers.get("Host", ""))
        forwarded = any(visitor.headers.get(name) is not None for name in _PROXY)
        from_here = _loopback(visitor.address) and (host == "localhost" or _loopback(host))
        return (from_here and not forwarded) or any(
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


# One holder of the controls: the others look on, see who it is, and may take over -------------------------------


class Controls:
    """Holder of the controls. Only the thread of the server uses it."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._holder = ""
        self._who = ""
        self._seen_s = 0.0
        self._connected: Counter[str] = Counter()

    @property
    def who(self) -> str:
        """Name of the holder; empty if the controls are free."""
        return (self._who or "somebody without a name") if self._is_held() else ""

    def holds(self, client: str) -> bool:
        """True if a page has the controls."""
        return self._is_held() and client == self._holder

    def had_last(self, client: str) -> bool:
        """True if a page has the controls, or had them before they were free."""
        return bool(client) and client == self._holder

    def take(self, client: str, who: str, over: bool = False) -> bool:
        """Give the controls to a page if they are free, or if it takes them over; whether it has them."""
        if not client or (self._is_held() and client != self._holder and not over):
            return False
        self._holder, self._who, self._seen_s = client, who, self._now_s()
        return True

    def connect(self, client: str) -> None:
        """A page is connected."""
        self._connected[client] += 1

    def disconnect(self, client: str) -> None:
        """A page is not connected any more."""
        self._connected[client] -= 1
        if self._connected[client] <= 0:
            del self._connected[client]
        if client == self._holder:
            self._seen_s = self._now_s()

    def _is_held(self) -> bool:
        here = self._connected[self._holder] > 0 or self._now_s() - self._seen_s < ABSENT_S
        return bool(self._holder) and here


# What a page asks for: JSON from the network, as requests of operators ------------------------------------------


def request_from_json(content: Any, robots: Mapping[str, Any] | list[str]) -> tuple[str, OperatorRequest]:
    """Robot and request of a page; ``InputError`` for wrong types. The planner checks what they mean."""
    if not isinstance(content, Mapping):
        raise InputError("a request is an object with a verb", "reload the page")
    robot = content.get("robot", "")
    if robot not in robots:
        raise InputError(f"there is no robot {robot!r:.50}", f"the robots are: {', '.join(robots) or '(one)'}")
    unknown = sorted(str(name) for name in content.keys() - _KNOWN - _OF_THE_PAGE)
    if unknown:
        raise InputError(f"a request has no {unknown[0]:.50}", "reload the page")
    return str(robot), OperatorRequest(**{
        name: _value(name, value) for name, value in content.items() if name not in _OF_THE_PAGE
    } | {"verb": _checked_text("verb", content.get("verb"))})  # fmt: skip


def who_of(content: Any) -> str:
    """Name of the operator of a page; empty if it is none."""
    who = content.get("who", "") if isinstance(content, Mapping) else ""
    return foreign_text(who)[:60] if isinstance(who, str) else ""


def _value(name: str, value: Any) -> Any:
    if name in _TEXTS:
        return _checked_text(name, value)
    if name in _NUMBER:
        return _number(name, value)
    if not isinstance(value, list) or len(value) > MAX_ITEMS:
        raise InputError(f"{name} must be a list of at most {MAX_ITEMS} items", "reload the page")
    if name in _NUMBERS:
        return tuple(_number(name, one) for one in value)
    if name in _NAMES:
        return tuple(_checked_text(name, one) for one in value)
    corners = []
    for corner in value:
        if not isinstance(corner, list) or len(corner) != 2:
            raise InputError(f"{name} must be a list of [x, y]", "reload the page")
        corners.append((_number(name, corner[0]), _number(name, corner[1])))
    return tuple(corners)


def _checked_text(name: str, value: Any) -> str:
    if not isinstance(value, str) or len(value) > MAX_TEXT or not value.isprintable():
        raise InputError(f"{name} must be a text of at most {MAX_TEXT} characters", "change it")
    return value


def _number(name: str, value: Any) -> float:
    number = finite_number(value)
    if number is None:
        raise InputError(f"{name} must be a number", "change it")
    return number


# How a browser gets to the page: a free port, an address with a token, as text and as a QR code -----------------


def free_port(wanted: int, host: str = "127.0.0.1", strict: bool = False) -> int:
    """A port on this machine: the one that is wanted if it is free, else another.

    :param strict: no other one will do
    :raises InputError: if there is none, or the address is not of this machine
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for port in (wanted,) if strict else (wanted, 0):
        try:
            with socket.create_server((host, port), family=family) as server:
                return int(server.getsockname()[1])
        except OSError as error:
            why = error.strerror or str(error)
    remedy = "end the program that uses it, which may be another survey, or choose another address and port"
    raise InputError(f"the page cannot have port {wanted} of {host}: {why}", remedy)


def tls_context(certificate: Path, key: Path | None) -> ssl.SSLContext:
    """Encryption with a certificate.

    :raises InputError: if the files are none, or do not belong together
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(certificate, key)
    except (OSError, ValueError) as error:
        remedy = "give a certificate and its key, both as PEM"
        raise InputError(f"is no certificate that can be used: {error}", remedy, certificate) from None
    return context


def own_certificate(folder: Path, host: str) -> Path:
    """A certificate with its key that this computer makes for itself; browsers warn of it once.

    :raises InputError: if openssl is missing
    """
    path = folder / "page.pem"
    if not path.is_file():
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        names = f"subjectAltName=DNS:{socket.gethostname()},DNS:{socket.gethostname()}.local"
        names += f",IP:{host}" if _address(host) else ""
        made = folder / "page.new"
        command = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj /CN=soilmoist"
        files = "-keyout", str(made), "-out", str(made.with_suffix(".crt"))
        try:
            subprocess.run(
                [*command.split(), "-days", "800", "-addext", names, *files], check=True, capture_output=True
            )
        except (OSError, subprocess.CalledProcessError) as error:
            remedy = "apt install openssl, or give --certificate and --key"
            raise InputError(f"openssl made no certificate: {error}", remedy) from None
        made.write_bytes(made.read_bytes() + made.with_suffix(".crt").read_bytes())
        made.replace(path)
    return path


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
    """Text with the address that lets one browser steer from another machine, and its QR code if possible."""
    address = f"{page.rstrip('/')}/?token={token}"
    text = f"to steer from another machine, open {address} (once)"
    try:
        code = optional_module("segno").make(address, error="l")
    except InputError:
        return text
    picture = io.StringIO()
    code.terminal(out=picture, compact=True)
    return f"{text}\n{picture.getvalue()}"
