# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Private domains on loopback."""

import os
import subprocess
import sys

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.nodes import process_group as loopback
from soilmoist_ros.nodes.process_group import DOMAINS, LAST_PORT, PORTS_EACH, free_domain, loopback_environment

HOLD = """
import sys
from soilmoist_ros.nodes import process_group as loopback
from soilmoist_ros.nodes.process_group import free_domain
loopback.DOMAINS = [*map(int, sys.argv[1:])] or loopback.DOMAINS
with free_domain() as domain:
    print(domain, flush=True)
    sys.stdin.read()
"""
ASIDE = 101
"""A domain that nobody else takes meanwhile."""
DISCOVERY = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER")


def hold(folder, *domains):
    """A process with another folder for its files, as in a container that shares the network."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, *map(str, domains)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"TMPDIR": str(folder)},
    )
    return process, int(process.stdout.readline())


def release(process):
    process.kill()
    process.communicate()


def test_every_holder_has_a_domain_of_its_own(tmp_path):
    with free_domain() as first, free_domain() as second:
        other, third = hold(tmp_path)
        try:
            assert len({first, second, third}) == 3
        finally:
            release(other)


def test_the_domain_of_a_killed_process_is_free_again(tmp_path, monkeypatch):
    other, domain = hold(tmp_path, ASIDE)
    assert domain == ASIDE
    monkeypatch.setattr(loopback, "DOMAINS", [domain])
    release(other)
    with free_domain() as mine:
        assert mine == domain


def test_a_domain_is_given_back_after_an_error(monkeypatch):
    monkeypatch.setattr(loopback, "DOMAINS", [ASIDE])
    with pytest.raises(OSError, match="the body"), free_domain() as domain:
        raise OSError("the body")
    with free_domain() as again:
        assert again == domain


def test_all_in_use(monkeypatch):
    with free_domain() as domain:
        monkeypatch.setattr(loopback, "DOMAINS", [domain])
        with pytest.raises(InputError, match=r"in use.*end other simulations"), free_domain():
            pass


def test_ports_lie_below_those_that_linux_hands_out():
    lowest = 32768
    assert LAST_PORT + PORTS_EACH * max(DOMAINS) < lowest
    assert 0 not in DOMAINS, "which is that of everybody else"


def test_nodes_meet_whatever_the_shell_has_set(tmp_path, monkeypatch):
    """The shell restricts ROS to a discovery server, or to the robot itself."""
    pytest.importorskip("rclpy")
    from ros_system import RosSystem
    from std_srvs.srv import Trigger

    for name, value in zip(DISCOVERY, ("OFF", "192.0.2.1", "192.0.2.1:11811"), strict=True):
        monkeypatch.setenv(name, value)
    for name in DISCOVERY:
        assert name in loopback_environment(3)
        monkeypatch.setenv(name, loopback_environment(3)[name])  # the observer runs in this process
    with RosSystem(tmp_path) as ros:
        assert ros.environment["ROS_DOMAIN_ID"] == str(ros.domain)
        ros.start("mapper", params={"field": "example"})
        assert ros.call(Trigger, "mapper/reset").success
