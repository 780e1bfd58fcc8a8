# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Opens line sources by address."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit

from soilmoist_ros.foundation import InputError, did_you_mean
from soilmoist_ros.sensing.links.line_source import LineSource
from soilmoist_ros.sensing.links.networks import Network, Senders, parse_networks
from soilmoist_ros.sensing.links.reconnecting import ReconnectingSource, Retry
from soilmoist_ros.sensing.links.recording import PlaybackClock, RecordingSource, StampOf
from soilmoist_ros.sensing.links.tcp import connect_tcp
from soilmoist_ros.sensing.links.udp import bind_udp

EXAMPLES = {
    "tcp": "tcp://192.168.1.20:5000",
    "udp": "udp://0.0.0.0:5000",
    "serial": "serial:///dev/ttyUSB0?baud=115200",
    "file": "file:///home/robot/survey.log?speed=10",
}
"""An example of each kind of address."""
_OPTIONS: dict[str, tuple[str, ...]] = {
    "tcp": ("interface",),
    "udp": ("from", "interface"),
    "serial": ("baud",),
    "file": ("speed",),
}
DEFAULT_BAUD = 115_200


def open_source(
    uri: str,
    retry: Retry | None = None,
    stamp_of: StampOf | None = None,
    playback: PlaybackClock | None = None,
) -> LineSource:
    """Line source at an address; it connects at the first read.

    * ``tcp://host:port`` connects to a server; ``?interface=eth1`` by this network interface only,
    * ``udp://0.0.0.0:port`` listens for datagrams; ``?from=192.168.5.20,10.0.5.0/24`` drops those of other
      senders, ``?interface=eth1`` those of other networks,
    * ``serial:///dev/ttyUSB0?baud=115200`` opens a port,
    * ``file:///path?speed=10`` plays a recording at ten times its speed, with ``speed=0`` as fast as possible.

    :param retry: pauses between attempts
    :param stamp_of: time of a recorded line; see :class:`RecordingSource`
    :param playback: shared by recordings that are played together
    :raises InputError: if the address is invalid, or a file cannot be read
    """
    try:
        parts = urlsplit(uri.strip())
        port = parts.port
    except ValueError as error:
        raise _bad(uri, str(error)) from None
    if parts.scheme not in EXAMPLES:
        kinds = f"{', '.join(EXAMPLES)}{did_you_mean(parts.scheme, EXAMPLES)}"
        raise _bad(uri, f"must begin with one of: {kinds}" if parts.scheme else "has no kind before '://'")
    options = _options(uri, parts)
    if parts.scheme in ("tcp", "udp"):
        if not parts.hostname or not port:
            raise _bad(uri, "lacks the host" if port else "lacks the port", [parts.scheme])
        if parts.path not in ("", "/"):
            raise _bad(uri, f"has a path {parts.path!r}, which this kind does not have", [parts.scheme])
        interface = options.get("interface", "")
        if parts.scheme == "tcp":
            return ReconnectingSource(uri, partial(connect_tcp, parts.hostname, port, interface), retry)
        senders = Senders(_networks(uri, options))
        connect = partial(bind_udp, parts.hostname, port, interface, senders)
        return ReconnectingSource(uri, connect, retry, senders=senders)
    if parts.netloc or not parts.path.startswith("/") or len(parts.path) < 2:
        raise _bad(uri, "lacks the absolute path: mind the three slashes", [parts.scheme])
    path = unquote(parts.path)
    if parts.scheme == "file":
        speed = _number(uri, options, "speed", 1.0, low=0.0)
        return RecordingSource(Path(path), speed, stamp_of, playback)
    # Only serial ports need this library.
    from soilmoist_ros.sensing.links.serial_port import open_serial

    baud = int(_number(uri, options, "baud", DEFAULT_BAUD, low=50.0))
    return ReconnectingSource(uri, partial(open_serial, path, baud), retry)


def _options(uri: str, parts: SplitResult) -> dict[str, str]:
    known = _OPTIONS[parts.scheme]
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    for name in options:
        if name not in known:
            there_are = f"there are: {', '.join(known)}" if known else "there are none"
            raise _bad(uri, f"has an unknown option {name!r}; {there_are}", [parts.scheme])
    return options


def _networks(uri: str, options: dict[str, str]) -> tuple[Network, ...]:
    if "from" not in options:
        return ()
    try:
        return parse_networks(options["from"])
    except ValueError as error:
        raise InputError(
            f"the address {uri!r} accepts data from no network: {error}",
            "give numeric addresses or networks: from=192.168.5.20 or from=192.168.5.20,10.0.5.0/24",
        ) from None


def _number(uri: str, options: dict[str, str], name: str, default: float, low: float) -> float:
    try:
        value = float(options.get(name, default))
    except ValueError:
        value = math.nan
    if not (low <= value < 1e7):
        raise _bad(uri, f"{name}={options[name]!r} is not a number of at least {low:g}", [urlsplit(uri).scheme])
    return value


def _bad(uri: str, message: str, kinds: list[str] | None = None) -> InputError:
    examples = [EXAMPLES[kind] for kind in kinds or EXAMPLES]
    return InputError(f"the address {uri!r} {message}", f"write it like {' or '.join(examples)}")
