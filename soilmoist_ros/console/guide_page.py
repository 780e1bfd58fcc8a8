# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page of a person with the sensor: its server, who asks on it, and the border of the field drawn there."""

from __future__ import annotations

import logging
import math
import socket
import ssl
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Final, Protocol

from soilmoist_ros.console.board import Board, RobotHistory
from soilmoist_ros.console.map_layers import MapLayers
from soilmoist_ros.console.plan_routes import SurveyFiles
from soilmoist_ros.console.plan_work import Walk
from soilmoist_ros.console.server import ConsoleServer
from soilmoist_ros.console.views import choices_view, health_view
from soilmoist_ros.console.visitors import LOOPBACK, Access, invitation, own_certificate, reachable, tls_context
from soilmoist_ros.exploration import OperatorRequest, Reply, ReplyCode, Verb
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.sensing import Driver, DriverSettings, PhoneReceiver, Site

STEP_S: Final = 0.2
SHOW_S: Final = 1.0
BORDER: Final = "field.yaml"
"""Name of the field file in the folder of a survey whose border was drawn on the page."""
AROUND_M: Final = 60.0
"""Half of the width of the map before there is a border [m]."""
_log = logging.getLogger(__name__)


class Asked(Protocol):
    """Receiver of the requests of the page: the border, then the survey."""

    def answer(self, request: OperatorRequest) -> Reply:
        """Do what the page asks for, in the thread of the loop."""

    def emergency(self, pressed: bool) -> None:
        """Stop, or end the stop of anybody."""


class GuidePage:
    """Serves the page; a context. What the page asks for waits for :meth:`take`.

    :param out: folder of the survey
    :param is_phone: whether the phone with the page is the receiver
    :param certificate: certificate and key, for a page by https; without, this computer makes one for a phone in
        a network that is the receiver
    :raises InputError: if the address cannot be used
    """

    def __init__(
        self,
        out: Path,
        host: str = "127.0.0.1",
        port: int = 0,
        is_phone: bool = False,
        certificate: tuple[Path, Path | None] | None = None,
    ) -> None:
        self.board = Board()
        self.walk = Walk(self.board, "")
        self.picture: MapLayers | None = None
        self.wake = threading.Event()
        """Set if something waits."""
        self.stopped = False
        self._waiting: deque[tuple[Callable[[Asked], Any], Future[Any]]] = deque()
        runs, phone = out.absolute().parent, PhoneReceiver() if is_phone else None
        access = Access((socket.gethostname(), f"{socket.gethostname()}.local"))
        for name, value in (("robots", [""]), ("choices", choices_view()), ("phone", is_phone)):
            self.board.put(name, value)
        self._server = ConsoleServer(
            self.board, self, access, lambda: self.picture, SurveyFiles(runs, runs), {"": self.walk},
            phone=phone,
        )  # fmt: skip
        tls = _tls(reachable(host), certificate, is_phone and host not in LOOPBACK)
        access.secure = tls is not None
        port = self._server.start(host, port, tls)
        self.address = f"http{'s' * access.secure}://{reachable(host)}:{port}/"
        """Address of the page."""
        self.invitation = "" if host in LOOPBACK else invitation(self.address, access.token)
        """Text for another device that is to steer; empty if the page is for this machine only."""

    def __enter__(self) -> GuidePage:
        return self

    def __exit__(self, *_error: object) -> None:
        if self.stopped:
            time.sleep(SHOW_S)  # the page hears of the end
        self._server.close()

    def stop(self) -> None:
        """End soon; signal handlers may call it."""
        self.stopped = True

    def receiver(self) -> PhoneReceiver | None:
        """A new receiver of the phone's positions, if the phone is the receiver: a driver closes its own."""
        if self._server.phone is not None:
            self._server.phone = PhoneReceiver()
        return self._server.phone

    def take(self, asked: Asked) -> None:
        """Answer what the page has asked for; wait for it up to :data:`STEP_S`."""
        self.wake.wait(STEP_S)
        self.wake.clear()
        while self._waiting:
            call, said = self._waiting.popleft()
            try:
                said.set_result(call(asked))
            except Exception as error:  # the page gets an answer
                _log.exception("a request of the page failed")
                said.set_exception(error)

    # What the page asks for (Steering) -----------------------------------------------------------------------

    def command(self, robot: str, request: OperatorRequest) -> Future[Reply]:
        """Pass a request on."""
        return self._later(lambda asked: asked.answer(request))

    def press(self, who: str) -> None:
        """Pause: nothing but the person moves the sensor."""
        self._later(lambda asked: asked.emergency(True))

    def release(self, who: str) -> None:
        """End the stop of anybody."""
        self._later(lambda asked: asked.emergency(False))

    def _later(self, call: Callable[[Asked], Any]) -> Future[Any]:
        said: Future[Any] = Future()
        said.set_running_or_notify_cancel()
        self._waiting.append((call, said))
        self.wake.set()
        return said


def _tls(host: str, certificate: tuple[Path, Path | None] | None, is_wanted: bool) -> ssl.SSLContext | None:
    """Encryption of the page, without which no phone in the network gives its position."""
    if certificate is not None:
        return tls_context(*certificate)
    if not is_wanted:
        return None
    try:
        path = own_certificate(Path.home() / ".local/share/soilmoist_ros", host)
    except InputError as error:
        _log.warning("the phone cannot give its position to a page without encryption: %s", error)
        return None
    _log.warning("the browser warns of the certificate that this computer has made: go on to the page")
    return tls_context(path, None)


# The border of the field, tapped on the map or walked, before the survey begins ----------------------------------


class FieldBorder:
    """Shows where the person is, and waits for a border.

    The datum is the first position. The page draws or walks a border as for a plan, and saves a field file; it is
    complete when the page asks for a change to that field.
    """

    def __init__(self, page: GuidePage, out: Path, devices: DriverSettings) -> None:
        self._page, self._board, self._file = page, page.board, out / BORDER
        self._driver = Driver(devices, Site(calibration=None), LocalFrame(0.0, 0.0), page.receiver())
        self._driver.refuse_taken()
        self._frame: LocalFrame | None = None
        self._history = RobotHistory(self._board, "")

    def run(self) -> Path | None:
        """Wait for the border; its file, or ``None`` if the page was stopped before."""
        self._board.put("border", True)
        self._driver.start(self._page.wake.set)
        try:
            while not self._page.stopped and not self._file.is_file():
                self._page.take(self)
                self._step(time.time())
        finally:
            self._driver.stop()
        if not self._file.is_file():
            self._board.put("over", True)
            return None
        self._board.put("border", False)
        return self._file

    def _step(self, now_s: float) -> None:
        for fix in self._driver.step(now_s).fixes:
            place, sd_m = fix.position, fix.position.horizontal_sd_m
            if self._frame is None:
                self._frame = LocalFrame(round(place.latitude_deg, 7), round(place.longitude_deg, 7))
                around = [[AROUND_M * x, AROUND_M * y] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
                datum = [self._frame.latitude_deg, self._frame.longitude_deg]
                self._board.put("field", {"name": "", "boundary": around, "no_go": [], "datum": datum})
            x_m, y_m = self._frame.to_local(place.latitude_deg, place.longitude_deg)[0].tolist()
            if math.isfinite(x_m) and math.isfinite(y_m):
                self._history.place(x_m, y_m, sd_m)
                self._page.walk.place(x_m, y_m, sd_m)
        self._board.hear("mission/")
        self._board.put("health", health_view(self._driver.health(now_s)))

    def answer(self, request: OperatorRequest) -> Reply:
        """Take the border that the page has saved."""
        if request.verb != Verb.CHANGE or not request.field:
            return Reply(ReplyCode.REFUSED, "not yet: the field has no border")
        self._file.parent.mkdir(parents=True, exist_ok=True)
        Path(request.field).replace(self._file)
        return Reply(ReplyCode.ACCEPTED, "the border is saved")

    def emergency(self, pressed: bool) -> None:
        """Nothing moves."""
