# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags beyond the limits of a recorder: retention.py."""

import os

import pytest
from bags import NOTES, START_NS, text_message

from soilmoist_ros.recording.bag.recorder import next_bag
from soilmoist_ros.recording.bag.retention import Excess, delete_bags, excess_text, find_excess
from soilmoist_ros.recording.bag.verify import recover_bag
from soilmoist_ros.recording.bag.writer import CHECKSUMS, BagWriter

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
    assert excess_text(Excess(), drops=False) == ""
    assert "1 bags are beyond keep_gb" in excess_text(Excess((tmp_path,), -1), drops=True)
    text = excess_text(Excess((), -2e6), drops=False)
    assert text.startswith("the recordings take 2 MB more than keep_gb: move some")
    assert excess_text(Excess((), -2e6), drops=True) == ""
