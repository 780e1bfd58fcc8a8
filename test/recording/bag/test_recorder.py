# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import errno
import os
import random
import shutil
import subprocess
import threading
import time

import pytest
from bags import NOTES, PRESSURE, START_NS, number_message, text_message
from rosbags.highlevel import AnyReader
from ruamel.yaml import YAML

from soilmoist_ros.foundation.errors import InputError, Level
from soilmoist_ros.recording import BagReader, TopicChoice, bag_info, recover_bag
from soilmoist_ros.recording.bag.metadata import Extent
from soilmoist_ros.recording.bag.recorder import (
    BagRecorder,
    Excess,
    RecorderState,
    SequenceGaps,
    check_name,
    delete_bags,
    excess_text,
    find_excess,
    next_bag,
    recorder_health,
)
from soilmoist_ros.recording.bag.scan import McapScan
from soilmoist_ros.recording.bag.writer import CHECKSUMS, BagWriter

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


def test_messages_wait_until_a_bag_can_be_made(make, tmp_path):
    (tmp_path / "out").write_text("in the way")
    recorder = make(new_bag=lambda: next_bag(tmp_path / "out", "run", "jazzy"))
    recorder.start()
    assert not recorder.wait_open(20)
    recorder.put(NOTES, START_NS, START_NS, DATA)
    assert "no recording can be made here" in recorder.state.problem
    (tmp_path / "out").unlink()
    wait_for(lambda: recorder.state.messages == 1)
    assert recorder.stop().problem == ""
    assert stamps(tmp_path / "out" / "run") == [START_NS]


def test_a_second_start_tries_at_once_and_says_what_holds_now(make, tmp_path):
    (tmp_path / "out").write_text("in the way")
    recorder = make(new_bag=lambda: next_bag(tmp_path / "out", "run", "jazzy"), retry_s=60.0)
    for _ in range(2):
        recorder.start()
        assert not recorder.wait_open(20)
        assert "no recording can be made here" in recorder.state.problem
    (tmp_path / "out").unlink()
    recorder.start()
    assert recorder.wait_open(20)
    assert recorder.stop().problem == ""


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


def test_bags_are_numbered_and_numbers_and_times_are_no_losses(tmp_path):
    for number in (1, 2):
        bag = next_bag(tmp_path, "run", "jazzy")
        bag.close({"closed_s": "1780000000"})
        noted = YAML(typ="safe").load(bag.folder / "metadata.yaml")["rosbag2_bagfile_information"]["custom_data"]
        assert noted == {"number": str(number), "closed_s": "1780000000"}
        assert bag_info(bag.folder).notes == {}


@pytest.mark.parametrize(
    ("state", "free", "level", "message"),
    [
        (RecorderState(recording=True), 10**9, Level.OK, "recording"),
        (RecorderState(), 10**9, Level.WARN, "not recording"),
        (RecorderState(recording=True), 10**6, Level.WARN, "only 1 MB left"),
        (RecorderState(recording=True, dropped=3), None, Level.WARN, "3 messages lost"),
        (RecorderState(recording=True, problem="disk full"), 0, Level.ERROR, "disk full"),
    ],
)
def test_health_tells_the_worst(state, free, level, message):
    health = recorder_health(state, free, 5e6)
    assert health.level is level
    assert message in health.message


def test_gaps_of_several_publishers_are_not_told_from_their_turns():
    gaps = SequenceGaps()
    for number in (1, 7, 2, 9):
        gaps.take("/t", number, 2)
    for number in (11, 12, 14):
        gaps.take("/t", number)
    assert gaps.lost == {"/t": 1}


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


def test_a_bag_has_its_notes_and_checksums_for_every_reader(make, tmp_path):
    recorder = make(notes=lambda: {"messages of /fix lost on the way": "7"})
    recorder.start()
    for number in range(50):
        topic, data = [(NOTES, DATA), (PRESSURE, number_message(number))][number % 2]
        recorder.put(topic, START_NS + number, START_NS, data)
    recorder.stop()
    bag = tmp_path / "run"
    assert stamps(bag) == list(range(START_NS, START_NS + 50))  # rosbags
    with BagReader(bag) as reader:
        assert reader.extent == Extent(50, START_NS, START_NS + 49)
    assert bag_info(bag).problems == ()
    assert bag_info(bag).notes == {"messages of /fix lost on the way": "7"}
    assert subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=bag).returncode == 0
    assert recover_bag(bag, tmp_path / "again").extent.messages == 50


def test_the_time_to_the_limit_of_the_recordings_is_a_warning():
    state = RecorderState(recording=True, rate_bps=1e6)
    health = recorder_health(state, 10**12, 5e8, full_soon_s=3600, left_bytes=1.8e9)
    assert (health.level, health.message) == (Level.WARN, "the recordings will reach keep_gb in 30 min")
    assert health.values["keep_gb reached in [h]"] == "0.5"
    assert recorder_health(state, 10**12, 5e8, full_soon_s=3600, left_bytes=10**10).level is Level.OK
    assert recorder_health(state, 10**12, 5e8, full_soon_s=3600).values["keep_gb reached in [h]"] == "unknown"


NOW_S = 1_780_000_000.0


@pytest.fixture
def bags(tmp_path):
    """Bags that ended 1 to 4 days ago; one that was never closed, and one that is being recorded, are older."""
    made = []
    for days in (4, 3, 2, 1):
        writer = BagWriter(tmp_path / f"days_{days}")
        writer.write(NOTES, START_NS, START_NS, text_message("note"))
        writer.close()
        os.utime(writer.folder / "metadata.yaml", times=(0, NOW_S - days * 86_400))
        made.append(writer.folder)
    killed = BagWriter(tmp_path / "killed")
    killed.abandon()
    (tmp_path / "notes").mkdir()
    (tmp_path / "link").symlink_to(made[0])
    recorded = BagWriter(tmp_path / "recorded")
    yield made
    recorded.abandon()


def record(out, number, changed_s):
    """A bag of the recorder that is closed while its clock has this time."""
    writer = next_bag(out, f"bag_{number}", "jazzy")
    writer.write(NOTES, START_NS, START_NS, text_message("note"))
    writer.close()
    os.utime(writer.folder / "metadata.yaml", times=(0, changed_s))
    return writer.folder


def without_number(folder, changed_s):
    with BagWriter(folder) as writer:
        writer.write(NOTES, START_NS, START_NS, text_message("note"))
    os.utime(folder / "metadata.yaml", times=(0, changed_s))
    return folder


def size(folder):
    return sum(file.stat().st_size for file in folder.glob("*.mcap"))


def test_the_oldest_bags_go_until_the_others_have_space(bags, tmp_path):
    total = sum(size(folder) for folder in tmp_path.iterdir() if not folder.is_symlink())
    assert find_excess(tmp_path, total + 7) == Excess((), 7)
    assert find_excess(tmp_path, total - 1) == Excess(tuple(bags[:1]), -1)
    assert find_excess(tmp_path, total - 1 - size(bags[0])).bags == tuple(bags[:2])
    found = find_excess(tmp_path, 0)
    assert found == Excess(tuple(bags), -total)
    assert delete_bags(found.bags) == bags
    assert sorted(path.name for path in tmp_path.iterdir()) == ["killed", "link", "notes", "recorded"]


def test_the_oldest_bag_is_the_first_whatever_the_clock_said_and_those_without_a_number_are_older(tmp_path):
    times = (1000.0, NOW_S, 2000.0, NOW_S + 366 * 86_400, NOW_S + 60, 3000.0)
    made = [record(tmp_path, number, time_s) for number, time_s in enumerate(times)]
    earlier = [without_number(tmp_path / f"earlier_{days}", NOW_S - days * 86_400) for days in (3, 2)]
    assert find_excess(tmp_path, 0).bags == (*earlier, *made)


def test_bags_that_people_made_with_other_programs_are_left_alone(tmp_path):
    theirs = without_number(tmp_path / "theirs", 0.0)
    (theirs / CHECKSUMS).unlink()
    made = record(tmp_path, 1, NOW_S)
    assert find_excess(tmp_path, size(made)) == Excess((), 0)
    assert find_excess(tmp_path, 0) == Excess((made,), -size(made))


def test_a_recovered_bag_is_not_the_oldest_where_no_clock_was_ever_right(tmp_path):
    made = [record(tmp_path, number, 1000.0 - number) for number in (1, 2)]
    killed = next_bag(tmp_path / "killed", "run", "jazzy")
    killed.write(NOTES, START_NS, START_NS, text_message("note"))
    killed.flush()
    killed.abandon()
    recovered = recover_bag(killed.folder, tmp_path / "recovered").folder
    made.append(record(tmp_path, 3, 500.0))
    assert find_excess(tmp_path, 0).bags == (*made[:2], recovered, made[2])


def test_what_is_beyond_the_limits_is_said_in_words(tmp_path):
    assert excess_text(Excess()) == ""
    assert "1 bags are beyond keep_gb" in excess_text(Excess((tmp_path,), -1))
    assert excess_text(Excess((), -2e6)) == "the recordings take 2 MB more than keep_gb: move some"
