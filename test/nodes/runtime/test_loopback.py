# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Private domains on loopback."""

import signal
import subprocess
import sys
import tempfile

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.nodes.runtime import loopback
from soilmoist_ros.nodes.runtime.loopback import DOMAINS, free_domain, loopback_environment

HOLD = """
import sys
from soilmoist_ros.nodes.runtime.loopback import free_domain
with free_domain() as domain:
    print(domain, flush=True)
    sys.stdin.read()
"""
DISCOVERY = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER")


@pytest.fixture
def locks(tmp_path, monkeypatch):
    """A separate folder of locks."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    yield tmp_path
    tempfile.tempdir = None


def hold():
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    return process, int(process.stdout.readline())


def release(process):
    process.kill()
    process.communicate()


def test_every_holder_has_a_domain_of_its_own(locks):
    with free_domain() as first, free_domain() as second:
        other, third = hold()
        try:
            assert [first, second, third] == list(DOMAINS[:3])
        finally:
            release(other)
    with free_domain() as again:
        assert again == first


def test_the_domain_of_a_killed_process_is_free_again(locks):
    other, domain = hold()
    other.send_signal(signal.SIGKILL)
    other.communicate()
    with free_domain() as mine:
        assert mine == domain


def test_a_domain_is_given_back_after_an_error(locks):
    with pytest.raises(OSError, match="the body"), free_domain() as domain:
        raise OSError("the body")
    with free_domain() as again:
        assert again == domain


def test_all_in_use(locks, monkeypatch):
    monkeypatch.setattr(loopback, "DOMAINS", range(7, 9))
    with (
        free_domain(),
        free_domain(),
        pytest.raises(InputError, match=r"in use.*end other simulations"),
        free_domain(),
    ):
        pass


def test_a_lock_of_another_user_is_passed_over(locks, monkeypatch):
    opened = type(locks).open

    def refuse(path, *arguments, **options):
        if path.name == "soilmoist_domain_1.lock":
            raise PermissionError(13, "Permission denied")
        return opened(path, *arguments, **options)

    monkeypatch.setattr(type(locks), "open", refuse)
    with free_domain() as domain:
        assert domain == 2


def test_a_disk_without_locks_is_reported(locks, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(locks / "none"))
    with pytest.raises(InputError, match="no lock can be made: No such file"), free_domain():
        pass


def test_ports_lie_below_those_that_linux_hands_out():
    lowest = 32768
    assert 7400 + 250 * DOMAINS[-1] + 11 + 2 * 100 < lowest
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
