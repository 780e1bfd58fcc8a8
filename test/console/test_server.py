# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The server of the console (server.py, visitors.py), without robots."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
import urllib.error
import urllib.request
from concurrent.futures import Future
from pathlib import Path

import aiohttp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.console import server as module
from soilmoist_ros.console.board import Board
from soilmoist_ros.console.map_layers import MapLayers
from soilmoist_ros.console.plan_routes import SurveyFiles
from soilmoist_ros.console.plan_work import Walk
from soilmoist_ros.console.server import ConsoleServer
from soilmoist_ros.console.views import field_view
from soilmoist_ros.console.visitors import Access, request_from_json
from soilmoist_ros.exploration.control.operator_request import OperatorRequest, Reply, ReplyCode
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping import CELL
from soilmoist_ros.sensing.position.phone import PhoneReceiver
from soilmoist_ros.simulation.fields.catalogue import surrogate_field

pytestmark = pytest.mark.usefixtures("urgent_jobs")
LIMIT_S = 180.0
"""Longest wait for an answer [s]; machines that run tests are busy."""


class Robots:
    """Robots that do as they are told, or do not answer."""

    def __init__(self, board):
        self.board, self.answers, self.asked, self.requests = board, True, [], []
        self.code = ReplyCode.REFUSED

    def command(self, robot, request):
        self.asked.append((robot, request.verb, request.who))
        self.requests.append(request)
        said = Future()
        if self.answers:
            said.set_result(Reply(self.code, "not now"))
        return said

    def press(self, who):
        self._say(True, who)

    def release(self, who):
        self._say(False, who)

    def _say(self, pressed, who):
        self.asked.append((pressed, who))
        if self.answers:
            self.board.put("mission/r1", {**self.board.get("mission/r1", {}), "emergency": pressed})
            self.board.hear("mission/r1")


class Served:
    def __init__(self, access, folder):
        self.board = Board()
        self.board.put("robots", ["r1"])
        self.board.put("field", field_view(surrogate_field("half-wet").field))
        self.robots, self.map = Robots(self.board), None
        self.walk = Walk(self.board, "r1")
        files = SurveyFiles(folder / "fields", folder)
        self.server = ConsoleServer(
            self.board, self.robots, access, lambda: self.map, files, {"r1": self.walk}, PhoneReceiver()
        )  # fmt: skip
        self.port = self.server.start("127.0.0.1", 0)

    def get(self, path, **headers):
        request = urllib.request.Request(f"http://127.0.0.1:{self.port}{path}", headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=LIMIT_S) as answer:
                return answer.status, answer.read(), answer.headers
        except urllib.error.HTTPError as error:
            with error:
                return error.code, error.read(), error.headers

    def post(self, path, content, kind="application/json", **headers):
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        request = urllib.request.Request(
            f"http://127.0.0.1:{self.port}{path}", body, {"Content-Type": kind, **headers}
        )
        try:
            with urllib.request.urlopen(request, timeout=LIMIT_S) as answer:
                return answer.status, json.loads(answer.read())
        except urllib.error.HTTPError as error:
            with error:
                return error.code, error.read().decode()


@pytest.fixture
def served(tmp_path):
    made = Served(Access(), tmp_path)
    yield made
    made.server.close()


@pytest.mark.slow
def test_a_connection_that_sends_no_request_is_ended(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "SILENT_S", 0.1)
    served = Served(Access(), tmp_path)
    asking = http.client.HTTPConnection("127.0.0.1", served.port, timeout=20)
    try:
        asking.request("GET", "/page/page.css")
        asking.getresponse().read()
        kept = asking.sock
        for begin in (b"", b"GET / HT"):
            with socket.create_connection(("127.0.0.1", served.port), 20) as silent:
                silent.sendall(begin)
                assert silent.recv(1) == b""
        asking.request("GET", "/page/page.css")
        asking.getresponse().read()
        assert asking.sock is kept is not None, "one that has asked stays"
    finally:
        asking.close()
        served.server.close()


def test_the_page_needs_nothing_from_elsewhere(served):
    status, page, headers = served.get("/", **{"Accept-Encoding": "gzip"})
    assert (status, headers["Content-Encoding"]) == (200, "gzip")
    assert "default-src 'self'" in headers["Content-Security-Policy"]
    total = len(page)
    for path in module.PAGE.iterdir():
        status, content, headers = served.get(f"/page/{path.name}", **{"Accept-Encoding": "gzip"})
        assert status == 200
        assert served.get(f"/page/{path.name}", **{"If-None-Match": headers["ETag"]})[0] == 304
        total += len(content)
        assert b"://" not in path.read_bytes().replace(b"http://www.w3.org/2000/svg", b"").replace(b"}//$", b"")
    assert total < 100_000
    assert served.get("/page/server.py")[0] == served.get("/page/..%2fserver.py")[0] == 404


@pytest.mark.slow
def test_other_sites_get_nothing(served):
    assert served.get("/", Host="evil.example")[0] == 403
    assert served.post("/stop", {}, Origin="http://evil.example")[0] == 403
    assert served.post("/stop", b"{}", "text/plain")[0] == 415
    assert served.post("/stop", b"{")[0] == 400
    assert served.post("/command", {"verb": "start", "who": "x" * 5_000_000})[0] in (400, 413)
    assert served.robots.asked == []


@pytest.mark.parametrize("secure", [False, True])
def test_a_token_becomes_a_cookie(served, secure):

    class Stay(urllib.request.HTTPRedirectHandler):
        def redirect_request(self, *_):
            return None

    access, away = served.server._access, {"X-Forwarded-For": "10.0.0.9"}
    access.secure = secure
    assert served.post("/stop", {}, **away)[0] == 403
    token = access.token
    opener = urllib.request.build_opener(Stay)
    with pytest.raises(urllib.error.HTTPError) as found:
        opener.open(f"http://127.0.0.1:{served.port}/?token={token}", timeout=LIMIT_S)
    found.value.close()
    assert (found.value.code, found.value.headers["Location"]) == (303, "./")
    cookie = found.value.headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert ("Secure" in cookie) is secure
    status, answer = served.post("/stop", {}, Cookie=cookie.split(";")[0], **away)
    assert (status, answer["acknowledged"]) == (200, True)


def test_commands_are_passed_on_with_their_reply(served, monkeypatch):
    status, reply = served.post("/command", {"robot": "r1", "verb": "start", "who": "Ada", "client": "a"})
    assert (status, reply) == (200, {"accepted": False, "code": "refused", "message": "not now"})
    assert served.robots.asked == [("r1", "start", "Ada")]
    assert served.post("/command", {"robot": "r2", "verb": "start", "client": "a"})[0] == 400
    monkeypatch.setattr(module, "REPLY_LIMIT_S", 0.05)
    served.robots.answers = False
    assert served.post("/command", {"robot": "r1", "verb": "start", "client": "a"})[1]["code"] == "no_answer"


def test_one_operator_has_the_controls_and_stop_is_for_all(served):
    start = {"robot": "r1", "verb": "start"}
    assert served.post("/command", {**start, "client": "a", "who": "Ada"})[0] == 200
    status, answer = served.post("/command", {**start, "client": "b", "who": "Bo"})
    assert status == 409
    assert "Ada has the controls" in answer
    assert served.post("/command", start)[0] == 409, "a page without a number has no controls"
    assert served.post("/take", {"who": "nobody"})[1] == {"holds": False}
    assert served.post("/release", {"client": "b"})[0] == 409
    assert served.post("/stop", {"client": "b"})[1]["acknowledged"]
    assert served.post("/take", {"client": "b", "who": "Bo"})[1] == {"holds": True}
    assert served.post("/release", {"client": "b"})[1]["acknowledged"]
    assert served.post("/command", {**start, "client": "a"})[0] == 409


def test_a_stop_is_acknowledged_by_the_robot_and_by_nobody_else(served, monkeypatch):
    assert served.post("/stop", {"who": "Ada"})[1] == {"acknowledged": True, "missing": []}
    assert served.post("/release", {"who": "Ada", "client": "a"})[1]["acknowledged"]
    monkeypatch.setattr(module, "STOP_LIMIT_S", 0.1)
    served.robots.answers = False
    served.board.put("mission/r1", {"emergency": True})  # of an earlier stop
    assert served.post("/stop", {"who": "Ada"})[1] == {"acknowledged": False, "missing": ["r1"]}


def test_the_map_and_its_values(served):
    assert served.get("/map/rate.png")[0] == 404
    cells = np.full((2, 2), np.nan, CELL)
    cells["rate"] = cells["rate_sd"] = 1.0
    cells["x"], cells["y"] = np.meshgrid([1.0, 3.0], [1.0, 3.0])
    served.map = MapLayers(cells, 1)
    status, picture, headers = served.get("/map/rate.png")
    assert (status, headers["Content-Type"], picture[:4]) == (200, "image/png", b"\x89PNG")
    assert served.get("/map/other.png")[0] == 404
    assert json.loads(served.get("/at?x=1&y=1")[1]) == {"values": {"rate": 1.0, "rate_sd": 1.0}}
    assert served.get("/at?x=1")[0] == 400


def first_messages(served, count, after=lambda number: None):
    """What a new viewer receives first; something may be done after each message."""

    async def look():
        messages, address = [], f"http://127.0.0.1:{served.port}/live"
        async with aiohttp.ClientSession() as session, session.ws_connect(address) as viewer:
            for number in range(count):
                messages.append(await viewer.receive(timeout=LIMIT_S))
                after(number)
        return messages

    return asyncio.run(look())


@pytest.mark.slow
def test_viewers_receive_what_changes_twice_a_second_at_most(served):
    def change(number):
        for step in range(100):
            served.board.put("a", (*range(number + 1), step))

    messages = [json.loads(one.data) for one in first_messages(served, 4, change)]
    assert messages[0]["set"]["viewer"] == {"may_steer": True, "holds": False, "holder": ""}
    assert messages[0]["set"]["robots"] == ["r1"]
    assert messages[1]["set"] == {"a": [0, 99]}
    assert [message["extend"] for message in messages[2:]] == [{"a": [1, [1, 99]]}, {"a": [2, [2, 99]]}]
    assert min(np.diff([message["now"] for message in messages])) > 0.45, "by the clock of the server"


def test_a_viewer_whose_update_fails_is_disconnected_and_named(served, caplog):
    served.board.put("a", object())
    assert first_messages(served, 1)[0].type is aiohttp.WSMsgType.CLOSE
    assert "a viewer is disconnected" in caplog.text
    served.board.put("a", 1)
    assert json.loads(first_messages(served, 1)[0].data)["set"]["a"] == 1


def test_those_who_only_look_keep_no_operator_out(served, monkeypatch):
    monkeypatch.setattr(module, "MAX_VIEWERS", 3)
    monkeypatch.setattr(module, "MAX_VIEWERS_EACH", 2)

    async def come():
        sessions = []

        async def look(number, **headers):
            sessions.append(
                aiohttp.ClientSession(connector=aiohttp.TCPConnector(local_addr=(f"127.0.0.{number}", 0)))
            )
            return await sessions[-1].ws_connect(f"http://127.0.0.1:{served.port}/live", headers=headers)

        far = {"Host": "192.168.1.5"}
        first = [await look(2, **far), await look(2, **far)]
        with pytest.raises(aiohttp.WSServerHandshakeError, match="503"):
            await look(2, **far)
        first.append(await look(3, **far))
        operators = [await look(1) for _ in range(3)]
        assert all([(await one.receive_json(timeout=LIMIT_S))["set"]["viewer"]["may_steer"] for one in operators])
        with pytest.raises(aiohttp.WSServerHandshakeError, match="503"):
            await look(4, **far)
        await first[0].close()
        while served.server._onlookers.total() > 2:
            await asyncio.sleep(0.01)
        await look(4, **far)
        for session in sessions:
            await session.close()

    asyncio.run(come())


@pytest.mark.slow
def test_what_a_plan_names_is_checked(served, tmp_path):
    square = {"datum": [53.2, -0.5], "boundary": [[0, 0], [20, 0], [20, 20]], "who": "Ada", "name": "../x"}
    code, answer = served.post("/field", square)
    assert (code, answer["area_m2"]) == (200, 200)
    assert (tmp_path / "fields" / answer["file"]).is_file()
    assert json.loads(served.get("/files")[1])["fields"] == [answer["file"]]
    asked = {"robot": "r1", "verb": "change", "field": answer["file"], "client": "c"}
    assert served.post("/command", asked)[0] == 200
    assert served.robots.requests[-1].field == str(tmp_path / "fields" / answer["file"])
    for path, wrong, said in (
        ("/command", {**asked, "field": "../../etc/passwd"}, "there is no field"),
        ("/command", {**asked, "earlier": ["gone"]}, "there is no run"),
        ("/command", {**asked, "earlier": "all"}, "must be a list"),
        ("/command", {**asked, "covariates": ["/etc/passwd"]}, "has no covariates"),
        ("/walk", {"robot": "r9", "do": "begin"}, "there is no such robot"),
        ("/walk", [], "a request is an object"),
        ("/plan", 5, "a request is an object"),
    ):
        code, answer = served.post(path, wrong)
        assert code == 400
        assert said in answer
    assert "error" in served.post("/field", {**square, "boundary": [[0, 0], [1, 1]]})[1]
    assert len(list((tmp_path / "fields").iterdir())) == 1
    for path in ("/field", "/walk", "/plan"):
        assert served.post(path, square, **{"Host": "192.168.1.5"})[0] == 403, "read-only without a token"


def test_a_port_in_use_is_said(served):
    other = ConsoleServer(
        served.board, served.robots, Access(), lambda: None, SurveyFiles(Path(), Path(), Path()), {}
    )
    with pytest.raises(InputError, match="cannot listen on 127"):
        other.start("127.0.0.1", served.port)


# Requests from the network (requests.py) ------------------------------------------------------------------------

JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
)
NAMES = ["robot", "verb", "who", "place", "dwell", "polygon", "stops", "hours", "until_sd", "other"]


@pytest.mark.parametrize(
    "content",
    [
        [], None, {"verb": "start", "robot": "other"}, {"robot": ""}, {"robot": "", "verb": 1},
        {"robot": "", "verb": "measure", "place": [True, 1]}, {"robot": "", "verb": "measure", "place": "1,2"},
        {"robot": "", "verb": "start", "who": "A\nB"}, {"robot": "", "verb": "start", "who": "x" * 500},
        {"robot": "", "verb": "change", "hours": float("inf")}, {"robot": "", "verb": "start", "extra": 1},
        {"robot": "", "verb": "rule_out", "polygon": [[1, 2, 3]]},
        {"robot": "", "verb": "rule_out", "polygon": [[1, 2]] * 1000},
    ],
)  # fmt: skip
def test_what_is_refused(content):
    with pytest.raises(InputError):
        request_from_json(content, [""])


@given(st.dictionaries(st.sampled_from(NAMES), JSON) | JSON)
@pytest.mark.slow
def test_anything_is_a_request_or_refused(content):
    try:
        robot, request = request_from_json(content, [""])
    except InputError:
        return
    assert robot == ""
    assert isinstance(request, OperatorRequest)
