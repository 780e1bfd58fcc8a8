# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A node process survives errors in callbacks, and ends cleanly."""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys

import pytest

pytest.importorskip("rclpy")
from rcl_interfaces.msg import Log
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Empty, Trigger

from msg_adapters.point_cloud import to_time
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.nodes.node_process import check_arguments
from soilmoist_ros.nodes.topics import CLOCK
from soilmoist_ros.nodes.topics import VISITS as ROSOUT

NODE = """
import logging, sys, threading, time
if MODE == "bare":
    sys.modules["rclpy.experimental"] = None
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Empty, Trigger
from soilmoist_ros.nodes.node_process import Aside, Soon
from soilmoist_ros.nodes.topics import RECORDS
from soilmoist_ros.nodes.node_process import run

class Example(Node):
    finished = False
    def __init__(self):
        super().__init__("example")
        self.create_service(Trigger, "break", self.on_break)
        self.create_service(Trigger, "end", self.on_end)
        self.stepped, self.failed = [], False
        if MODE == "timers":
            self.create_timer(0.05, self.fail_once)
            self.create_timer(0.05, lambda: self.stepped.append(self.get_clock().now().nanoseconds))
            self.create_service(Trigger, "stepped", self.on_stepped)
        self.create_service(Trigger, "work", self.on_work)
        if MODE == "hears":
            self.create_subscription(String, "last", lambda message: print(message.data), RECORDS)
        if MODE == "last":
            self.last = self.create_publisher(String, "last", RECORDS)
            self.matched = self.create_timer(0.05, self.wait_for_receiver)
        if MODE in ("busy", "bare"):
            for _ in range(4):
                self.create_timer(0.001, lambda: time.sleep(0.05))
        self.released = threading.Event()
        self.aside = Aside(self)
        self.aside.offer(Trigger, "slow", self.slow)
        self.aside.offer(Trigger, "fail", self.fail)
        self.aside.offer(Empty, "fail_without_fields", self.fail)
        self.create_service(Trigger, "do", self.do)
        self.create_service(Trigger, "release", self.release)
        self.soon = Soon(self, lambda: print("soon in", threading.current_thread().name))
        print("ready")
    def fail_once(self):
        if not self.failed:
            self.failed = True
            raise RuntimeError("a mistake at first")
        self.get_logger().info("again", once=True)
    def wait_for_receiver(self):
        if self.last.get_subscription_count():
            print("matched")
            self.matched.cancel()
    def on_stepped(self, request, response):
        response.message = " ".join(map(str, self.stepped))
        self.stepped.clear()
        return response
    def on_work(self, request, response):
        print("works")
        time.sleep(1.0)
        print("has worked")
        return response
    def on_break(self, request, response):
        if MODE == "timers": raise RuntimeError("a mistake")
        core = logging.getLogger("soilmoist_ros.exploration")
        core.info("a fact")
        core.warning("a %s", "warning")
        core.error("an error")
        core.debug("a detail")
        return response
    def on_end(self, request, response):
        self.finished = True
        return response
    def slow(self, request, response):
        response.success = self.released.wait(30)
        return response
    def fail(self, request, response):
        response.success = True
        raise RuntimeError("a mistake aside")
    def do(self, request, response):
        self.aside.do(lambda: 1 / 0, "a division")
        return response
    def release(self, request, response):
        asking = threading.Thread(target=lambda: [self.soon.ask() for _ in range(5)])
        asking.start()
        asking.join()
        self.released.set()
        return response
    def close(self):
        self.aside.close()
        if MODE == "last":
            self.last.publish(String(data="the last message"))
        print("closed")

run(Example)
"""


@pytest.fixture
def example(ros, tmp_path):
    def start(mode, **params):
        script = tmp_path / "example"
        script.write_text(f"#!{sys.executable}\nMODE = {mode!r}\n{NODE}")
        script.chmod(0o755)
        return ros.start(str(script), params=params)

    return start


@pytest.mark.parametrize("mode", ["busy", pytest.param("bare", id="without experimental executors")])
def test_a_busy_node_ends_in_good_order(ros, example, mode):
    process = example(mode)
    ros.wait_for(lambda: "ready" in process.output())
    assert process.stop(signal.SIGTERM) == 0
    assert process.output().split() == ["ready", "closed"]


def test_it_lasts_until_receivers_have_its_last_message_but_not_for_ever(ros, example):
    receiver = example("hears")
    ros.wait_for(lambda: "ready" in receiver.output())  # its script is read
    for hears in (True, False):
        process = example("last")
        ros.wait_for(lambda process=process: "matched" in process.output())
        receiver.process.send_signal(signal.SIGSTOP)
        process.process.send_signal(signal.SIGTERM)
        ros.wait_for(lambda process=process: "closed" in process.output())
        with pytest.raises(subprocess.TimeoutExpired):
            process.process.wait(0.5)
        if hears:
            receiver.process.send_signal(signal.SIGCONT)
            ros.wait_for(lambda: "the last message" in receiver.output())
        assert process.wait() == 0
    receiver.process.send_signal(signal.SIGCONT)


def test_log_of_the_core_long_work_of_services_and_an_interrupt(ros, example):
    said = ros.collect(Log, "/rosout", ROSOUT)
    process = example("works")
    slow, work = (ros.node.create_client(Trigger, name) for name in ("slow", "work"))
    ros.wait_for(lambda: slow.service_is_ready() and work.service_is_ready())
    ros.wait_for(lambda: ros.node.get_publishers_info_by_topic("/rosout"))
    ros.call(Trigger, "break")
    ros.wait_for(lambda: any(one.msg == "an error" for one in said))
    heard = [(one.level, one.msg) for one in said if one.name == "example"]
    assert heard == [(20, "a fact"), (30, "a warning"), (40, "an error")]
    assert "[WARN]" in process.output()
    assert process.output().count("a warning") == 1

    waiting = slow.call_async(Trigger.Request())
    ros.call(Trigger, "release")
    ros.wait_for(waiting.done)
    assert waiting.result().success, "the release came while the work went on"
    ros.wait_for(lambda: "soon" in process.output())

    answer = ros.call(Trigger, "fail")
    assert (answer.success, answer.message) == (False, "RuntimeError: a mistake aside")
    assert ros.call(Empty, "fail_without_fields") == Empty.Response()
    ros.call(Trigger, "do")
    ros.wait_for(lambda: "ZeroDivisionError" in process.output())
    for name in ("fail", "fail_without_fields", "a division"):
        assert f"{name} failed; the node continues" in process.output()
    assert ros.call(Trigger, "slow").success, "the thread continues"

    work.call_async(Trigger.Request())
    ros.wait_for(lambda: "works" in process.output())
    assert process.stop(signal.SIGINT) == 0
    assert process.output().split("\n")[-3:] == ["has worked", "closed", ""], "the signal waits for the callback"
    assert process.output().count("soon in MainThread") == process.output().count("soon") == 1


def test_callbacks_and_timers_survive_errors_and_a_simulated_clock_that_goes_back(ros, example):
    clock = ros.node.create_publisher(Clock, "/clock", CLOCK)
    process = example("timers", use_sim_time=True)
    ros.wait_for(lambda: "ready" in process.output() and clock.get_subscription_count())

    def stepped(now_s):
        """Times at which the timer was called, after simulated time has passed from a time on."""
        calls = []
        times = iter(range(10_000))
        while len(calls) < 5:
            clock.publish(Clock(clock=to_time(now_s + 0.1 * next(times))))
            calls += map(int, ros.call(Trigger, "stepped").message.split())
        return [call * 1e-9 for call in calls]

    late = stepped(5000.0)
    assert "a mistake at first" in process.output()
    ros.wait_for(lambda: "again" in process.output(), message="the timer that failed")
    assert min(late) >= 5000.0
    early = stepped(100.0)
    assert 100.0 <= early[-1] < 5000.0
    client = ros.node.create_client(Trigger, "break")
    ros.wait_for(client.service_is_ready)
    client.call_async(Trigger.Request())
    ros.wait_for(lambda: "RuntimeError: a mistake\n" in process.output())
    assert "a callback failed; the node continues" in process.output()
    end = ros.node.create_client(Trigger, "end")
    ros.wait_for(end.service_is_ready)
    end.call_async(Trigger.Request())  # the process may end before its answer is out
    assert process.wait() == 0


# Arguments that ROS would ignore ---------------------------------------------------------------------------------


def test_arguments_that_ros_ignores_are_refused():
    check_arguments(["mapper", "old_name:=new_name", "__ns:=/r1", "--ros-args", "-p", "field:=x"], "mapper")
    for word, remedy in (
        ("field:=x", "-p field:=x"),
        ("--params", "-p NAME:=VALUE"),
        ("--help", "mapper.yaml lists"),
    ):
        with pytest.raises(InputError, match=f"mapper has no argument '{word}' -> .*{remedy}"):
            check_arguments(["mapper", word, "--ros-args", "-p", "site:=y"], "mapper")


# Memory that was freed goes back to the system: memory.py -------------------------------------------------------

WORK = """
import re, threading
import numpy as np
from soilmoist_ros.nodes.node_process import return_memory

def resident_mb():
    return int(re.search(r"VmRSS:\\s+(\\d+)", open("/proc/self/status").read())[1]) / 1024

def work():
    np.ones(3_500_000)
    arrays = [np.ones(500_000) for _ in range(8)]

if {returned}:
    assert return_memory()
before_mb = resident_mb()
thread = threading.Thread(target=work)
thread.start()
thread.join()
print(resident_mb() - before_mb)
"""


def growth_mb(returned: bool) -> float:
    """How much a process grows by arrays that a thread has used and freed [MB]."""
    command = [sys.executable, "-c", WORK.format(returned=returned)]
    return float(subprocess.run(command, capture_output=True, check=True, timeout=60).stdout)


@pytest.mark.process
@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "gnu_get_libc_version"), reason="not the GNU C library")
def test_what_a_thread_frees_goes_back():
    assert growth_mb(True) < 10 < growth_mb(False)


@pytest.mark.parametrize(
    ("name", "absent"),
    [
        ("recorder", "scipy pydantic soilmoist_ros.mapping.field_map"),
        ("sensor_driver", "scipy soilmoist_ros.mapping.field_map"),
        ("planner", "scipy pynmea2 soilmoist_ros.reporting.outputs"),
        ("mapper", "scipy pynmea2 soilmoist_ros.reporting.outputs"),
    ],
)
@pytest.mark.process
def test_a_node_loads_no_code_that_it_may_never_need(name, absent):
    code = f"import sys, soilmoist_ros.nodes.{name}; print(*({set(absent.split())} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
