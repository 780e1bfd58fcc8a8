# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import errno
import os
import random
import shutil
import threading
import time

import pytest
from bags import NOTES, START_NS, text_message
from rosbags.highlevel import AnyReader

from soilmoist_ros.foundation.errors import InputError, Level
from soilmoist_ros.recording import TopicChoice, bag_info
from soilmoist_ros.recording.bag.recorder import BagRecorder, RecorderState, check_name, next_bag, recorder_health
from soilmoist_ros.recording.bag.scan import McapScan

DATA = text_message("x" * 90)


def wait_for(condition, limit_s=20.0):
    deadline = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.005)


def stamps(folder):
    with AnyReader([folder]) as reader:
        return [time_ns for _, time_ns, _ in reader.messages()]


@pytest.fixture
def make(tmp_path):
    made = []

    def new(**settings):
        bags = settings.pop("new_bag", lambda: next_bag(tmp_path, "run", "jazzy"))
        made.append(BagRecorder(bags, **{"flush_period_s": 0.02, "retry_s": 0.02, **settings}))
        return made[-1]

    yield new
    for recorder in made:
        recorder.stop()


def test_messages_of_many_threads_are_all_in_the_bag(make, tmp_path):
    recorder = make()
    recorder.start()

    def send(first):
        for number in range(500):
            recorder.put(NOTES, first + number, START_NS, DATA)

    threads = [threading.Thread(target=send, args=(START_NS + 1000 * k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    state = recorder.stop()
    assert (state.messages, state.dropped, state.problem, state.waiting_bytes) == (2000, 0, "", 0)
    assert sorted(stamps(tmp_path / "run")) == [START_NS + 1000 * k + n for k in range(4) for n in range(500)]


def test_messages_wait_until_a_bag_can_be_made_and_a_second_start_tries_at_once(make, tmp_path):
    (tmp_path / "out").write_text("in the way")
    recorder = make(new_bag=lambda: next_bag(tmp_path / "out", "run", "jazzy"), retry_s=60.0)
    for _ in range(2):
        recorder.start()
        assert not recorder.wait_open(20)
        assert "no recording can be made here" in recorder.state.problem
    recorder.put(NOTES, START_NS, START_NS, DATA)
    (tmp_path / "out").unlink()
    recorder.start()
    assert recorder.wait_open(20)
    assert recorder.stop().problem == ""
    assert stamps(tmp_path / "out" / "run") == [START_NS]


def test_what_is_too_much_to_wait_is_dropped_and_counted(make, tmp_path):
    (tmp_path / "out").write_text("in the way")
    recorder = make(
        new_bag=lambda: next_bag(tmp_path / "out", "run", "jazzy"), capacity_bytes=10 * len(DATA), retry_s=60.0
    )
    recorder.start()
    assert not recorder.wait_open(20)
    taken = [recorder.put(NOTES, START_NS + n, START_NS, DATA) for n in range(25)]
    assert taken == [True] * 10 + [False] * 15
    (tmp_path / "out").unlink()
    state = recorder.stop()
    assert (state.messages, state.dropped, state.problem) == (10, 15, "")
    assert stamps(tmp_path / "out" / "run") == [START_NS + n for n in range(10)]


def fail_with(monkeypatch, code, meanwhile=lambda: None):
    """Writes to MCAP files fail until the returned event is set; each calls ``meanwhile`` first."""
    healed, real = threading.Event(), os.write

    def write(descriptor, data):
        if not healed.is_set() and os.readlink(f"/proc/self/fd/{descriptor}").endswith(".mcap"):
            meanwhile()
            raise OSError(code, os.strerror(code))
        return real(descriptor, data)

    monkeypatch.setattr("soilmoist_ros.recording.bag.writer.os.write", write)
    return healed


@pytest.mark.slow
def test_a_disk_that_fills_up_within_a_batch_keeps_every_message_once_and_in_order(make, tmp_path, monkeypatch):
    """Large messages, so that the disk refuses the first of a batch while the others still wait."""
    large, all_wait, late = text_message(random.Random(1).randbytes(2_000_000).hex()), threading.Event(), [4]

    def new_bag():
        assert all_wait.wait(20)
        return next_bag(tmp_path, "run", "jazzy")

    def one_more():
        while late:
            recorder.put(NOTES, START_NS + late.pop(), START_NS, DATA)

    healed = fail_with(monkeypatch, errno.ENOSPC, one_more)
    recorder = make(new_bag=new_bag)
    recorder.start()
    for number in range(4):
        assert recorder.put(NOTES, START_NS + number, START_NS, large)
    all_wait.set()
    wait_for(lambda: "full" in recorder.state.problem)
    assert (recorder.state.messages, recorder.state.waiting_bytes) == (1, 3 * len(large) + len(DATA))
    healed.set()
    wait_for(lambda: recorder.state.messages == 5)
    assert recorder.stop().dropped == 0
    path = tmp_path / "run" / "run_0.mcap"
    written = [(message.log_ns, message.data) for message in McapScan(path).messages()]
    assert written == [(START_NS + number, DATA if number == 4 else large) for number in range(5)]


def test_a_disk_that_is_gone_is_left_for_a_new_bag(make, tmp_path, monkeypatch):
    healed = fail_with(monkeypatch, errno.EIO)
    recorder = make(retry_s=0.1)
    recorder.start()
    recorder.put(NOTES, START_NS, START_NS, DATA)
    wait_for(lambda: (state := recorder.state).dropped and "can no longer be written" in state.problem)
    healed.set()
    wait_for(lambda: recorder.state.bag is not None and not recorder.state.problem)
    recorder.put(NOTES, START_NS + 1, START_NS, DATA)
    state = recorder.stop()
    # Only the messages that the first bag accepted are lost and counted.
    assert (state.messages, state.dropped) == (1, 1)
    assert state.bag is not None
    assert stamps(state.bag) == [START_NS + 1]


def test_a_stop_while_the_disk_is_full_says_what_is_lost(make, tmp_path, monkeypatch, caplog):
    recorder = make()
    recorder.start()
    for number in range(5):
        recorder.put(NOTES, START_NS + number, START_NS, DATA)
    assert recorder.wait_open(20)
    wait_for(lambda: len(list(McapScan(tmp_path / "run" / "run_0.mcap").messages())) == 5)
    fail_with(monkeypatch, errno.ENOSPC)
    recorder.put(NOTES, START_NS + 5, START_NS, DATA)
    wait_for(lambda: "nothing is lost so far" in recorder.state.problem)
    recorder.put(NOTES, START_NS + 6, START_NS, DATA)
    state = recorder.stop()
    assert (state.messages, state.dropped) == (5, 2)
    assert state.problem.endswith("is full: 2 messages are lost; to restore what it has: soilmoist bag recover")
    assert caplog.messages[-1] == state.problem
    assert bag_info(state.bag).extent.messages == 5


def test_a_second_recorder_of_the_same_name_is_refused_while_the_first_records(make, tmp_path):
    first, second = make(), make()
    first.start()
    assert first.wait_open(20)
    second.start()
    assert not second.wait_open(20)
    assert "another recorder is writing" in second.state.problem
    second.put(NOTES, START_NS, START_NS, DATA)
    first.stop()
    wait_for(lambda: second.state.messages == 1)
    second.stop()
    assert stamps(tmp_path / "run_2") == [START_NS]


@pytest.mark.parametrize("name", ["../x", "a/b", ".", "..", ".hidden", "a b"])
def test_names_that_are_no_folder_names_are_refused(name):
    with pytest.raises(InputError, match="not a valid name"):
        check_name(name)


def test_numbers_and_times_of_earlier_releases_are_no_losses(tmp_path):
    bag = next_bag(tmp_path, "run", "jazzy")
    bag.close({"number": "2", "closed_s": "1780000000", "messages of /fix lost on the way": "7"})
    assert bag_info(bag.folder).notes == {"messages of /fix lost on the way": "7"}


@pytest.mark.parametrize(
    ("state", "free", "level", "message"),
    [
        (RecorderState(recording=True), 10**9, Level.OK, "recording"),
        (RecorderState(), 10**9, Level.WARN, "not recording"),
        (RecorderState(recording=True), 10**6, Level.WARN, "only 1 MB left"),
        (
            RecorderState(recording=True, rate_bps=1e6),
            1_800_000_000,
            Level.WARN,
            "the disk will be full in 30 min",
        ),
        (RecorderState(recording=True, dropped=3), None, Level.WARN, "3 messages lost"),
        (RecorderState(recording=True, problem="disk full"), 0, Level.ERROR, "disk full"),
    ],
)
def test_health_tells_the_worst(state, free, level, message):
    health = recorder_health(state, free, 5e6, full_soon_s=3600)
    assert health.level is level
    assert message in health.message


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("/counts", True),
        ("/robot/soil_map", True),
        ("/camera/image", False),
        ("/topological_navigation/_action/status", True),
        ("/topological_navigation/_action/feedback", False),
        ("/_hidden", False),
    ],
)
def test_topics_are_chosen(name, wanted):
    assert TopicChoice(exclude="/camera/.*").wanted(name) is wanted
    assert not TopicChoice(include="/nothing").wanted(name)


def removed(bag):
    shutil.rmtree(bag)


def moved(bag):
    bag.rename(bag.with_name("elsewhere"))


def replaced(bag):
    path = bag / f"{bag.name}_0.mcap"
    path.unlink()
    path.write_bytes(b"another file")


@pytest.mark.parametrize("lose", [removed, moved, replaced])
def test_a_bag_that_is_gone_is_an_error_and_a_new_one_begins(make, tmp_path, lose):
    recorder = make()
    recorder.start()
    for number in range(5):
        recorder.put(NOTES, START_NS + number, START_NS, DATA)
    wait_for(lambda: recorder.state.messages == 5)
    lose(tmp_path / "run")
    wait_for(lambda: recorder.state.gone and recorder.state.bag is not None and not recorder.state.problem)
    recorder.put(NOTES, START_NS + 9, START_NS, DATA)
    wait_for(lambda: recorder.state.messages == 1)
    state = recorder.stop()
    assert (state.messages, state.dropped) == (1, 5)
    assert state.gone == f"{tmp_path / 'run'} was deleted or moved while it was recorded, with 5 messages"
    assert stamps(state.bag) == [START_NS + 9]
    assert bag_info(state.bag).notes == {"messages lost in writing": f"5 ({state.gone})"}
    health = recorder_health(state, 10**12, 1e6)
    assert (health.level, health.message) == (Level.ERROR, state.gone)
