# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Processes that start and end together. The nodes are small programs, except for one real node."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.nodes import process_group
from soilmoist_ros.nodes.process_group import (
    DOMAINS,
    LAST_PORT,
    PORTS_EACH,
    ProcessGroup,
    free_domain,
    loopback_environment,
)

LIMIT_S = 20.0
NODES = {
    # Reports its start and its end.
    "good": """
        signal.signal(signal.SIGINT, lambda *_: end("SIGINT"))
        signal.signal(signal.SIGTERM, lambda *_: end("SIGTERM"))
        note("ready")
        while True:
            signal.pause()
    """,
    "deaf": """
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        note("ready")
        while True:
            signal.pause()
    """,
    "short": """
        print("I have failed", flush=True)
        sys.exit(3)
    """,
    "parent": """
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1000)"])
        note(f"ready {child.pid}")
        if "leave" in sys.argv[-1]:
            sys.exit(0)
        signal.pause()
    """,
    # A program without signal handlers.
    "plain": """
        note("ready")
        time.sleep(1000)
    """,
}
HEAD = """
import os, signal, subprocess, sys, time
name = {name!r}
def note(text):
    with open({journal!r}, "a") as file:
        file.write(f"{{name}} {{os.getpid()}} {{text}}\\n")
def end(why):
    note(why)
    sys.exit(0)
"""


@pytest.fixture
def journal(tmp_path, monkeypatch):
    """Replaces nodes by the small programs; returns the file to which they write."""
    path = tmp_path / "journal.txt"
    path.write_text("")
    folder = tmp_path / "soilmoist_ros" / "nodes"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    (folder.parent / "__init__.py").write_text("")
    for name, body in NODES.items():
        for copy in (name, f"{name}_2"):
            text = HEAD.format(name=copy, journal=str(path)) + textwrap.dedent(body)
            (folder / f"{copy}.py").write_text(text)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return path


def wait_for(condition):
    deadline = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.01)


def said(journal):
    """Messages of the programs, as name, process number and text."""
    return [line.split(maxsplit=2) for line in journal.read_text().splitlines(keepends=False)]


def ready(journal, count):
    wait_for(lambda: sum(text.startswith("ready") for _, _, text in said(journal)) == count)


def numbers(journal):
    return {int(number) for _, number, _ in said(journal)}


def gone(number):
    """Whether a process has ended; a zombie has ended as well."""
    try:
        with open(f"/proc/{number}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return True


def group(folder):
    return ProcessGroup({}, folder / "log")


def start(nodes, *names):
    for name in names:
        nodes.start(name, nodes.log(name).with_suffix(".yaml"))


def test_nodes_end_with_the_group_the_last_started_first(journal, tmp_path):
    with group(tmp_path) as nodes:
        start(nodes, "good", "good_2", "salt/good")
        ready(journal, 3)
        assert nodes.ended() == {}
        assert nodes.log("salt/good").name == "salt_good.log"
        commands = [Path(f"/proc/{number}/cmdline").read_text().split("\0") for number in numbers(journal)]
        assert {"__ns:=/", "__ns:=/salt"} == {word for words in commands for word in words if "__ns" in word}
        with pytest.raises(ValueError, match="good was started before"):
            start(nodes, "good")
    assert [name for name, _, text in said(journal) if text == "SIGINT"] == ["good", "good_2", "good"]
    assert all(gone(number) for number in numbers(journal))


@pytest.mark.parametrize("waits", [True, False])
def test_a_node_that_ignores_sigint_is_killed_also_if_the_body_fails_and_nobody_waits(
    journal, tmp_path, monkeypatch, waits
):
    def impatient(_seconds):
        raise KeyboardInterrupt

    names = ("good", "deaf", "plain", "good_2")
    with pytest.raises(KeyboardInterrupt), group(tmp_path) as nodes:  # noqa: PT012
        start(nodes, *names)
        ready(journal, len(names))
        if not waits:
            monkeypatch.setattr(process_group.time, "sleep", impatient)
        nodes.stop(limit_s=2.0)
        raise KeyboardInterrupt
    if waits:
        assert [name for name, _, text in said(journal) if text == "SIGINT"] == ["good_2", "good"]
    assert all(gone(number) for number in numbers(journal))


def test_how_nodes_have_ended_and_what_they_have_started_ends_with_them(journal, tmp_path):
    with group(tmp_path) as nodes:
        start(nodes, "short", "plain", "good", "parent")
        nodes.start("parent_2", tmp_path / "leave")  # ends by itself
        ready(journal, 4)
        os.kill(nodes.pid("plain"), signal.SIGKILL)
        wait_for(lambda: len(nodes.ended()) == 3)
        assert nodes.ended() == {"short": 3, "plain": -signal.SIGKILL, "parent_2": 0}
        assert nodes.log("short").read_text() == "I have failed\n"
        children = {name: int(text.split()[1]) for name, _, text in said(journal) if "parent" in name}
        wait_for(lambda: gone(children["parent_2"]))
    wait_for(lambda: gone(children["parent"]))
    assert nodes.ended() == {}
    nodes.stop()  # a second stop does nothing


PROGRAM = """
import signal, sys, time
from pathlib import Path
from soilmoist_ros.nodes.process_group import ProcessGroup
if "background" in sys.argv:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # as a shell does for `program &`
with ProcessGroup({"PYTHONPATH": sys.argv[1]}, Path(sys.argv[1]) / "log") as nodes:
    for name in sys.argv[2].split(","):
        nodes.start(name, Path("none"))
    if "background" not in sys.argv:
        time.sleep(1000)
    sys.stdin.readline()
"""


@contextmanager
def program(folder, *arguments):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(folder), *arguments],
        env={**environment, "PYTHONPATH": str(process_group.__file__).partition("/soilmoist_ros/")[0]},
        cwd=folder / "soilmoist_ros",  # so that the package is imported, not the small programs
        stdin=subprocess.PIPE,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.skipif(sys.platform != "linux", reason="other kernels send no signal when the parent ends")
def test_nodes_end_when_their_parent_is_killed(journal, tmp_path):
    with program(tmp_path, "good,plain") as process:
        ready(journal, 2)
        found = numbers(journal)
        process.kill()
        process.wait()
        wait_for(lambda: all(gone(number) for number in found))
    assert [text for name, _, text in said(journal) if name == "good"] == ["ready", "SIGTERM"], "in good order"


def test_an_interrupt_reaches_nodes_of_a_program_in_the_background(journal, tmp_path):
    with program(tmp_path, "plain", "background") as process:
        ready(journal, 1)
        process.communicate(b"\n", timeout=LIMIT_S)  # not the 15 s after which stop() kills
        assert process.returncode == 0
    log = (tmp_path / "log" / "plain.log").read_text()
    assert "KeyboardInterrupt" in log


# Private domains on loopback ------------------------------------------------------------------------------------

HOLD = """
import sys
from soilmoist_ros.nodes.process_group import free_domain
with free_domain() as domain:
    print(domain, flush=True)
    sys.stdin.read()
"""


def test_every_holder_has_a_domain_of_its_own_until_it_ends(tmp_path, monkeypatch):
    """One of them with another folder for its files, as in a container that shares the network."""
    command, environment = [sys.executable, "-c", HOLD], os.environ | {"TMPDIR": str(tmp_path)}
    with free_domain() as first, free_domain() as second:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        with subprocess.Popen(command, **pipes, env=environment) as other:
            third = int(other.stdout.readline())
            assert len({first, second, third}) == 3
            monkeypatch.setattr(process_group, "DOMAINS", [third])
            with pytest.raises(InputError, match=r"in use.*end other simulations"), free_domain():
                pass
            other.kill()
        with pytest.raises(OSError, match="the body"), free_domain() as domain:
            raise OSError("the body")
        with free_domain() as again:
            assert again == domain == third


def test_ports_lie_below_those_that_linux_hands_out_and_the_shell_of_a_robot_changes_nothing():
    lowest = 32768
    assert LAST_PORT + PORTS_EACH * max(DOMAINS) < lowest
    assert 0 not in DOMAINS, "which is that of everybody else"
    discovery = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_STATIC_PEERS": "", "ROS_DISCOVERY_SERVER": ""}
    assert loopback_environment(3).items() >= {"ROS_DOMAIN_ID": "3", **discovery}.items()
