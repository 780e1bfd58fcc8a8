# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags beyond the limits of a recorder: retention.py."""

import math
import os

import pytest
from bags import NOTES, START_NS, text_message

from soilmoist_ros.recording.bag.recorder import next_bag
from soilmoist_ros.recording.bag.retention import (
    CLOSED_S,
    ClockWatch,
    Excess,
    Limits,
    delete_bags,
    excess_text,
    find_excess,
)
from soilmoist_ros.recording.bag.verify import recover_bag
from soilmoist_ros.recording.bag.writer import BagWriter

NOW_S = 1_780_000_000.0


@pytest.fixture
def bags(tmp_path):
    """Bags that ended 1 to 4 days ago; one that was never closed, and one that is being recorded, are older."""
    made = []
    for days in (4, 3, 2, 1):
        writer = BagWriter(tmp_path / f"days_{days}")
        writer.write(NOTES, START_NS, START_NS, text_message("note"))
        writer.close({CLOSED_S: f"{NOW_S - days * 86_400:.0f}"})
        os.utime(writer.folder / "metadata.yaml", times=(0, NOW_S - days * 86_400))
        made.append(writer.folder)
    killed = BagWriter(tmp_path / "killed")
    killed.abandon()
    (tmp_path / "notes").mkdir()
    (tmp_path / "link").symlink_to(made[0])
    recorded = BagWriter(tmp_path / "recorded")
    yield made
    recorded.abandon()


def record(out, number, changed_s, **notes):
    """A bag of the recorder that is closed while its clock has this time."""
    writer = next_bag(out, f"bag_{number}", "jazzy")
    writer.write(NOTES, START_NS, START_NS, text_message("note"))
    writer.close(notes)
    os.utime(writer.folder / "metadata.yaml", times=(0, changed_s))
    return writer.folder


def without_number(folder, changed_s):
    with BagWriter(folder) as writer:
        writer.write(NOTES, START_NS, START_NS, text_message("note"))
    os.utime(folder / "metadata.yaml", times=(0, changed_s))
    return folder


def size(folder):
    return sum(file.stat().st_size for file in folder.glob("*.mcap"))


def test_old_bags_are_found(bags, tmp_path):
    assert find_excess(tmp_path, Limits(age_s=2.5 * 86_400), NOW_S, True) == Excess(tuple(bags[:2]))
    assert find_excess(tmp_path, Limits(), NOW_S, True) == Excess()
    assert not Limits().exist
    assert Limits(age_s=1.0).exist


def test_the_oldest_bags_go_until_the_others_have_space(bags, tmp_path):
    total = sum(size(folder) for folder in tmp_path.iterdir() if not folder.is_symlink())
    assert find_excess(tmp_path, Limits(size_bytes=total + 7), NOW_S, True) == Excess((), 7)
    assert find_excess(tmp_path, Limits(size_bytes=total - 1), NOW_S, True) == Excess(tuple(bags[:1]), -1)
    assert find_excess(tmp_path, Limits(size_bytes=total - 1 - size(bags[0])), NOW_S, False).bags == tuple(
        bags[:2]
    )
    found = find_excess(tmp_path, Limits(size_bytes=0, age_s=math.inf), NOW_S, False)
    assert found == Excess(tuple(bags), -total)
    assert delete_bags(found.bags) == bags
    assert sorted(path.name for path in tmp_path.iterdir()) == ["killed", "link", "notes", "recorded"]


def test_only_a_bag_that_a_right_clock_has_closed_can_be_too_old(bags, tmp_path):
    month = Limits(age_s=30 * 86_400)
    never = record(tmp_path, 1, 1000.0)  # the robot has started in 1970
    late = record(tmp_path, 2, 1000.0, closed_s=f"{NOW_S:.0f}")
    assert find_excess(tmp_path, month, NOW_S, True) == Excess((), undated=(never,))
    far_s = NOW_S + 366 * 86_400
    assert find_excess(tmp_path, month, far_s, False).bags == ()
    assert find_excess(tmp_path, month, far_s, True).bags == (*bags, late)


def test_the_oldest_bag_is_the_first_whatever_the_clock_said(tmp_path):
    times = (1000.0, NOW_S, 2000.0, NOW_S + 366 * 86_400, NOW_S + 60, 3000.0)
    right = {1: f"{NOW_S:.0f}", 4: f"{NOW_S + 60:.0f}"}
    made = [
        record(tmp_path, number, time_s, **({CLOSED_S: right[number]} if number in right else {}))
        for number, time_s in enumerate(times)
    ]
    earlier = without_number(tmp_path / "earlier", NOW_S + 30)
    expected = [*made[:4], earlier, *made[4:]]
    assert find_excess(tmp_path, Limits(size_bytes=0), NOW_S + 3600, True).bags == tuple(expected)


def test_bags_of_an_earlier_release_are_older_than_those_of_a_clock_that_was_never_right(tmp_path):
    earlier = [without_number(tmp_path / f"earlier_{days}", NOW_S - days * 86_400) for days in (3, 2)]
    made = [record(tmp_path, number, 1000.0 - number) for number in (1, 2)]
    assert find_excess(tmp_path, Limits(size_bytes=0), NOW_S, True).bags == (*earlier, *made)


def test_no_bag_is_older_than_one_with_a_lower_number(tmp_path):
    """A clock that is synchronised to a wrong server says 2020."""
    closed = (NOW_S - 2 * 86_400, 1_580_000_000.0, NOW_S - 3600)
    made = [record(tmp_path, n, time_s, closed_s=f"{time_s:.0f}") for n, time_s in enumerate(closed)]
    assert find_excess(tmp_path, Limits(age_s=30 * 86_400), NOW_S, True) == Excess()
    assert find_excess(tmp_path, Limits(age_s=86_400), NOW_S, True).bags == tuple(made[:2])


def test_a_bag_of_the_future_keeps_no_other(tmp_path):
    closed = (NOW_S + 3650 * 86_400, NOW_S - 55 * 86_400, NOW_S - 54 * 86_400)
    made = [record(tmp_path, n, time_s, closed_s=f"{time_s:.0f}") for n, time_s in enumerate(closed)]
    assert find_excess(tmp_path, Limits(age_s=30 * 86_400), NOW_S, True).bags == tuple(made[1:])


def test_a_recovered_bag_is_not_the_oldest_where_no_clock_was_ever_right(tmp_path):
    made = [record(tmp_path, number, 1000.0 - number) for number in (1, 2)]
    killed = next_bag(tmp_path / "killed", "run", "jazzy")
    killed.write(NOTES, START_NS, START_NS, text_message("note"))
    killed.flush()
    killed.abandon()
    recovered = recover_bag(killed.folder, tmp_path / "recovered").folder
    made.append(record(tmp_path, 3, 500.0))
    assert find_excess(tmp_path, Limits(size_bytes=0), NOW_S, True).bags == (*made[:2], recovered, made[2])


def test_what_is_beyond_the_limits_is_said_in_words(tmp_path):
    assert excess_text(Excess(), drops=False) == ""
    assert "1 bags are beyond keep_days or keep_gb" in excess_text(Excess((tmp_path,), -1), drops=True)
    text = excess_text(Excess((), -2e6), drops=False)
    assert text.startswith("the recordings take 2 MB more than keep_gb: move some")
    assert excess_text(Excess((), -2e6), drops=True) == ""
    assert "1 bags seem older than keep_days" in excess_text(Excess(undated=(tmp_path,)), drops=True)


CLOCK_NOW_S = 1_780_000_000.0


@pytest.fixture
def watch():
    """A watch that has seen a synchronised clock for an hour."""
    seen = ClockWatch()
    for minute in range(61):
        seen.look(CLOCK_NOW_S + 60 * minute, 60.0 * minute, synchronised=minute == 0)
    return seen


def test_a_clock_is_settled_after_an_hour_and_needs_no_network_then(watch):
    assert (watch.right, watch.settled) == (True, True)
    watch.look(CLOCK_NOW_S + 3661.0, 3660.0, synchronised=False)  # it has drifted
    assert (watch.right, watch.settled) == (True, True)


@pytest.mark.parametrize("step_s", [366 * 86_400.0, -86_400.0])
def test_a_clock_that_was_set_is_not_settled(watch, step_s):
    watch.look(CLOCK_NOW_S + 3660.0 + step_s, 3660.0, synchronised=False)
    assert (watch.right, watch.settled) == (False, False)
    watch.look(CLOCK_NOW_S + 3720.0, 3720.0, synchronised=True)  # and back again
    assert (watch.right, watch.settled) == (True, False)
