# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Serves the console: the page, the pictures of the map, what has changed, and the way for commands."""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import hashlib
import html
import json
import logging
import socket
import ssl
import threading
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import Future
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol
from weakref import WeakSet

from soilmoist_ros.console.board import Board, changes
from soilmoist_ros.console.map_layers import MapLayers
from soilmoist_ros.console.plan_routes import PlanRoutes, SurveyFiles
from soilmoist_ros.console.plan_work import Walk
from soilmoist_ros.console.runs import Jobs, RunRoutes
from soilmoist_ros.console.visitors import COOKIE, Access, Controls, Visitor, request_from_json, who_of
from soilmoist_ros.exploration import OperatorRequest, Reply
from soilmoist_ros.foundation import InputError, optional_module
from soilmoist_ros.reporting import jsonable
from soilmoist_ros.sensing import PhoneReceiver

if TYPE_CHECKING:
    from aiohttp import web

PAGE: Final = Path(__file__).parent / "page"
UPDATE_S: Final = 0.5
"""Shortest time between two messages to a viewer [s]."""
IDLE_S: Final = 2.0
"""Longest time between two messages to a viewer: the page notices a lost connection [s]."""
REPLY_LIMIT_S: Final = 5.0
"""Longest wait for the answer of a planner [s]."""
STOP_LIMIT_S: Final = 3.0
"""Longest wait for a planner that says that its emergency stop is pressed [s]."""
CHOICE_LIMIT_S: Final = 60.0
"""Longest wait for a planner that opens a field and earlier runs [s]."""
MAX_BODY: Final = 3 * 1024 * 1024
"""Longest request: a file with a boundary [bytes]."""
MAX_CLIENT: Final = 64
MAX_VIEWERS, MAX_VIEWERS_EACH = 50, 10
"""Viewers who may only look: all, and of one address."""
KEEP_S: Final = 75.0
"""Longest time without a request on a connection [s]."""
SILENT_S: Final = 10.0
"""Time without an acknowledgement after which the reader of an event stream is gone, and between two looks at
connections that have sent no request, which aiohttp before 3.14 never ends [s].
"""
_KINDS: Final = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
    ".json": "application/json",
}
_HEADERS: Final = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob:; frame-ancestors 'none'; "
    "base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
_READ_ONLY: Final = "this page is read-only: open the address with the token that the console prints"

_log = logging.getLogger(__name__)

Handler = Callable[[Any], Awaitable[Any]]


class Steering(Protocol):
    """Commands from the console to the robots; called in the thread of the server."""

    def command(self, robot: str, request: OperatorRequest) -> Future[Reply]:
        """Pass a request to the planner of a robot."""

    def press(self, who: str) -> None:
        """Press the emergency stop of all robots."""

    def release(self, who: str) -> None:
        """Release the emergency stop of all robots."""


class ConsoleServer:
    """An HTTP server in a thread.

    :param board: what to show; the sections ``robots`` (names) and ``mission/NAME`` are read here, too
    :param steering: receives the commands; ``None`` if nobody may steer
    :param access: who may
    :param picture: the latest map
    :param files: files on this computer: runs, and what may be chosen for the next mission
    :param walks: walks by the names of the robots
    :param phone: takes positions of the phone that has the controls; ``None`` if the receiver is another one
    """

    def __init__(
        self,
        board: Board,
        steering: Steering | None,
        access: Access,
        picture: Callable[[], MapLayers | None],
        files: SurveyFiles,
        walks: Mapping[str, Walk],
        phone: PhoneReceiver | None = None,
    ) -> None:
        self._web = optional_module("aiohttp.web")
        self._board, self._steering, self._access, self._picture = board, steering, access, picture
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="console", daemon=True)
        self._viewers: set[web.WebSocketResponse] = set()
        self._ends = False
        self._onlookers: Counter[str] = Counter()
        self._asking: WeakSet[asyncio.Transport] = WeakSet()
        self._controls = Controls()
        self.operators = 0  # open pages that may steer
        self._files, self._walks = files, walks
        self.phone = phone
        self._jobs: Jobs | None = None
        self._runner: web.AppRunner | None = None

    def start(self, host: str, port: int, tls: ssl.SSLContext | None = None) -> int:
        """Start to serve; returns the port. ``InputError`` if the address cannot be used."""
        self._thread.start()
        try:
            return asyncio.run_coroutine_threadsafe(self._open(host, port, tls), self._loop).result(20.0)
        except OSError as error:
            self.close()
            raise InputError(
                f"the console cannot listen on {host}, port {port}: {error.strerror or error}",
                "set the parameter port to another number, or 0 for a free one; or end what uses it",
            ) from None

    def close(self) -> None:
        """End serving; viewers are disconnected."""
        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._shut(), self._loop).result(10.0)
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(5.0)

    # Start and end -------------------------------------------------------------------------------------------

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_forever()
        self._loop.close()

    async def _open(self, host: str, port: int, tls: ssl.SSLContext | None) -> int:
        web = self._web
        app = web.Application(client_max_size=MAX_BODY, middlewares=[self._guard()])
        app.router.add_get("/", self._on_page)
        app.router.add_get("/page/{name}", self._on_file)
        app.router.add_get("/map/{layer}.png", self._on_map)
        app.router.add_get("/at", self._on_at)
        app.router.add_get("/live", self._on_live)
        self._jobs = Jobs(self._board)
        RunRoutes(web, self._files.runs, self._jobs).add(app, self._operators)
        PlanRoutes(web, self._files, self._jobs, self._walks).add(app, self._operators)
        here = (("position", self._on_position),) if self.phone else ()
        for name, handler in (("stop", partial(self._on_stop, True)), ("take", self._on_take), *here):
            app.router.add_post(f"/{name}", self._operators(handler))
        for name, handler in (("command", self._on_command), ("release", partial(self._on_stop, False))):
            app.router.add_post(f"/{name}", self._operators(handler, holder=True))
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0, keepalive_timeout=KEEP_S)
        await self._runner.setup()
        await web.TCPSite(self._runner, host, port, ssl_context=tls).start()
        self._loop.call_later(SILENT_S, self._end_silent, [])
        return int(self._runner.addresses[0][1])

    def _end_silent(self, before: list[asyncio.Transport]) -> None:
        """End connections that had sent no request at the last look, nor have since: each keeps a file open."""
        server = self._runner.server if self._runner is not None else None
        found = [one.transport for one in server.connections if one.transport] if server is not None else []
        silent = [one for one in found if one not in self._asking]
        for one in silent:
            if one in before:
                one.abort()
        self._loop.call_later(SILENT_S, self._end_silent, silent)

    async def _shut(self) -> None:
        self._ends = True
        if self._jobs is not None:
            await self._jobs.close()
        for viewer in tuple(self._viewers):
            await viewer.close(code=1001, message=b"the console ends")
        if self._runner is not None:
            await self._runner.cleanup()

    # Guard ---------------------------------------------------------------------------------------------------

    def _guard(self) -> Any:
        """A middleware that refuses requests of other sites, and adds the headers to all answers."""

        async def guard(request: Any, handler: Handler) -> Any:
            if request.transport is not None:
                self._asking.add(request.transport)
            if refusal := self._access.refusal(_visitor(request)):
                return self._web.Response(status=403, text=f"refused: {refusal}\n")
            response = await handler(request)
            if not response.prepared:
                for name, value in _HEADERS.items():
                    response.headers.setdefault(name, value)
            return response

        return self._web.middleware(guard)

    def _operators(self, handler: Handler, holder: bool = False) -> Handler:
        """A handler with JSON for operators only; for ``holder`` they must have the controls, or get free ones."""

        async def answer(request: Any) -> Any:
            if request.content_type != "application/json":  # other sites can send forms, but not JSON
                return self._web.json_response({"error": "send JSON"}, status=415)
            if not self._may_steer(request):
                return self._web.json_response({"error": _READ_ONLY}, status=403)
            try:
                content = await request.json()
                if not isinstance(content, dict):
                    raise InputError("a request is an object", "reload the page")
                if holder and not self._controls.take(_client(content), who_of(content)):
                    error = f"{self._controls.who or 'nobody'} has the controls: take over first"
                    return self._web.json_response({"error": error}, status=409)
                return self._web.json_response(await handler(content))
            except InputError as error:
                return self._web.json_response({"error": str(error)}, status=400)
            except (ValueError, RecursionError):
                return self._web.json_response({"error": "this is not JSON"}, status=400)

        return answer

    def _may_steer(self, request: Any) -> bool:
        return self._steering is not None and self._access.may_steer(_visitor(request))

    # What is shown -------------------------------------------------------------------------------------------

    async def _on_page(self, request: Any) -> Any:
        token = request.query.get("token")
        if token is None:
            return self._file(request, "index.html")
        session = self._access.session(token)
        response = self._web.Response(status=303, headers={"Location": "./"})  # the token leaves the address
        if session is not None:
            response.set_cookie(
                COOKIE, session, httponly=True, samesite="Strict", path="/", secure=self._access.secure
            )
        return response

    async def _on_file(self, request: Any) -> Any:
        return self._file(request, request.match_info["name"])

    def _file(self, request: Any, name: str) -> Any:
        if name not in _files():
            raise self._web.HTTPNotFound
        content, mark = _files()[name]
        headers = {"ETag": mark, "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
        if request.headers.get("If-None-Match") == mark:
            return self._web.Response(status=304, headers=headers)
        if "gzip" in request.headers.get("Accept-Encoding", ""):
            headers["Content-Encoding"] = "gzip"
        else:
            content = gzip.decompress(content)
        return self._web.Response(
            body=content, headers=headers, content_type=_KINDS[Path(name).suffix], charset="utf-8"
        )

    async def _on_map(self, request: Any) -> Any:
        picture = self._picture()
        try:
            if picture is None:
                raise KeyError
            content = await self._loop.run_in_executor(None, picture.png, request.match_info["layer"])
        except KeyError:
            raise self._web.HTTPNotFound from None
        return self._web.Response(body=content, content_type="image/png", headers={"Cache-Control": "no-store"})

    async def _on_at(self, request: Any) -> Any:
        try:
            x_m, y_m = float(request.query["x"]), float(request.query["y"])
        except (KeyError, ValueError):
            return self._web.json_response({"error": "give x and y in metres"}, status=400)
        picture = self._picture()
        return self._web.json_response({"values": picture.at(x_m, y_m) if picture else {}})

    async def _on_live(self, request: Any) -> Any:
        if self._may_steer(request):  # who only looks must not keep operators out
            return await self._follow(request, may_steer=True)
        address = _visitor(request).address
        if self._onlookers.total() >= MAX_VIEWERS or self._onlookers[address] >= MAX_VIEWERS_EACH:
            return self._web.Response(status=503, text="too many viewers are connected already\n")
        self._onlookers[address] += 1
        try:
            return await self._follow(request, may_steer=False)
        finally:
            self._onlookers -= Counter([address])

    async def _follow(self, request: Any, may_steer: bool) -> Any:
        client = request.query.get("client", "")[:MAX_CLIENT]
        is_stream = "text/event-stream" in request.headers.get("Accept", "")
        self.operators += may_steer
        self._controls.connect(client)
        try:
            return await (self._stream if is_stream else self._socket)(request, client, may_steer)
        finally:
            self.operators -= may_steer
            self._controls.disconnect(client)

    async def _socket(self, request: Any, client: str, may_steer: bool) -> Any:
        viewer = self._web.WebSocketResponse(heartbeat=10.0, compress=True, max_msg_size=1024)
        await viewer.prepare(request)
        self._viewers.add(viewer)
        sender = asyncio.create_task(self._show(viewer, client, may_steer))
        try:
            async for _ in viewer:  # what a viewer sends is ignored; the loop ends with the connection
                pass
        finally:
            self._viewers.discard(viewer)
            sender.cancel()
        return viewer

    async def _show(self, viewer: Any, client: str, may_steer: bool) -> None:
        """Keep a viewer up to date; one that cannot be is disconnected, which its page says."""
        try:
            await self._send(viewer.send_str, client, may_steer)
        except ConnectionError:  # the viewer is gone
            pass
        except Exception as error:
            _log.error("a viewer is disconnected, since its update failed: %r", error)
            await viewer.close(code=1011)

    async def _stream(self, request: Any, client: str, may_steer: bool) -> Any:
        """Events for a browser that opens no WebSocket; what has a gap of :data:`SILENT_S` is lost."""
        headers = {**_HEADERS, "Cache-Control": "no-store", "X-Accel-Buffering": "no"}
        response = self._web.StreamResponse(headers=headers)
        response.content_type = "text/event-stream"
        if hasattr(socket, "TCP_USER_TIMEOUT"):  # a phone that is out of reach does not say goodbye
            line = request.transport.get_extra_info("socket")
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, round(1000 * SILENT_S))
        await response.prepare(request)

        async def send(text: str) -> None:
            await asyncio.wait_for(response.write(f"data: {text}\n\n".encode()), SILENT_S)

        with contextlib.suppress(OSError, TimeoutError):
            await self._send(send, client, may_steer)
        return response

    async def _send(self, send: Callable[[str], Awaitable[None]], client: str, may_steer: bool) -> None:
        sent: dict[str, Any] = {}
        while not self._ends:
            version, sent_s = self._board.version, self._board.now_s()
            viewer = {"may_steer": may_steer, "holds": self._controls.holds(client), "holder": self._controls.who}
            now = {**self._board.snapshot(), "viewer": viewer}
            message = {**changes(sent, now), "now": round(sent_s, 2), "utc": round(time.time(), 1)}
            await send(_text(message))
            sent = now
            await asyncio.sleep(UPDATE_S)
            while not self._ends and self._board.version == version and self._board.now_s() < sent_s + IDLE_S:
                await asyncio.sleep(UPDATE_S / 5)

    # What is asked -------------------------------------------------------------------------------------------

    async def _on_command(self, content: Any) -> dict[str, Any]:
        assert self._steering is not None
        robot, asked = request_from_json(content, self._board.get("robots", []))
        request = self._files.resolved(asked)
        opens = request.field or request.earlier
        limit_s = CHOICE_LIMIT_S if opens else REPLY_LIMIT_S
        try:
            future = asyncio.wrap_future(self._steering.command(robot, request))
            reply = await asyncio.wait_for(future, limit_s)
        except TimeoutError:
            text = f"no answer from the planner in {limit_s:g} s: it is not known whether the command is used"
            return {"accepted": False, "code": "no_answer", "message": text}
        return {"accepted": reply.accepted, "code": str(reply.code), "message": reply.message}

    async def _on_take(self, content: Any) -> dict[str, Any]:
        return {"holds": self._controls.take(_client(content), who_of(content), over=True)}

    async def _on_position(self, content: Any) -> dict[str, Any]:
        """A position; never of a phone that nobody has given the controls: it may be far from the sensor."""
        assert self.phone is not None
        if not self._controls.had_last(_client(content)):
            raise InputError("another phone gives the position", "take over on this one, if the sensor is here")
        self.phone.take(content, time.time())
        return {}

    async def _on_stop(self, pressed: bool, content: Any) -> dict[str, Any]:
        """Press or release, and wait until every planner says that its emergency stop is pressed or released."""
        assert self._steering is not None  # only who may steer comes here
        asked_s = self._board.now_s()
        (self._steering.press if pressed else self._steering.release)(who_of(content))
        limit_s = STOP_LIMIT_S if pressed else STOP_LIMIT_S + 2.0  # a release waits for the silence of others

        def missing() -> list[str]:
            return [
                robot
                for robot in self._board.get("robots", [])
                if self._board.heard_s(f"mission/{robot}") < asked_s
                or self._board.get(f"mission/{robot}", {}).get("emergency") is not pressed
            ]

        while (left := missing()) and self._board.now_s() < asked_s + limit_s:
            await asyncio.sleep(0.05)
        return {"acknowledged": not left, "missing": [robot or "the planner" for robot in left]}


def _client(content: Any) -> str:
    client = content.get("client", "") if isinstance(content, dict) else ""
    return client[:MAX_CLIENT] if isinstance(client, str) else ""


def _text(message: Mapping[str, Any]) -> str:
    """JSON of a message, with null for numbers that are not finite."""
    try:
        return json.dumps(message, separators=(",", ":"), allow_nan=False)
    except ValueError:
        return json.dumps(jsonable(message), separators=(",", ":"))


def _visitor(request: Any) -> Visitor:
    address = request.remote or ""
    return Visitor(address.partition("%")[0], request.headers, request.cookies.get(COOKIE, ""))


@cache
def _files() -> dict[str, tuple[bytes, str]]:
    """Compressed content and mark of each file of the page, by name."""
    found: dict[str, bytes] = {}
    languages = {path.name: json.loads(path.read_bytes()) for path in sorted(PAGE.glob("*.json"))}
    names = json.dumps({name.removesuffix(".json"): own["language"] for name, own in languages.items()})
    for path in PAGE.iterdir():
        if path.suffix in _KINDS:
            content = path.read_bytes().replace(b'languages="{}"', f'languages="{html.escape(names)}"'.encode())
            if own := languages.get(path.name):  # what a language lacks is English
                merged = {part: languages["en.json"][part] | own[part] for part in ("texts", "sentences")}
                content = json.dumps(merged, ensure_ascii=False).encode()
                found[f"{path.stem}.rare.json"] = json.dumps(own.get("rare", {}), ensure_ascii=False).encode()
            found[path.name] = content
    packed = {name: gzip.compress(content, 9, mtime=0) for name, content in found.items()}
    return {name: (content, f'"{hashlib.sha256(content).hexdigest()[:16]}"') for name, content in packed.items()}
