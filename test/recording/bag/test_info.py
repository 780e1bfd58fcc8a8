# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import io
from dataclasses import replace

import pytest
from bags import NOTES, PRESSURE, START_NS, number_message, text_message
from rich.console import Console

from soilmoist_ros.recording.bag.info import info_table, print_plain, recovery_table
from soilmoist_ros.recording.bag.verify import bag_info, find_gaps, recover_bag
from soilmoist_ros.recording.bag.writer import BagWriter


def shown(content):
    console = Console(file=io.StringIO(), width=60)
    print_plain(console, content)
    return console.file.getvalue()


def test_a_whole_bag(bag):
    info = bag_info(bag.folder)
    assert info.whole
    assert (info.storage, info.remedy, info.recording) == ("mcap", "", False)
    assert info.extent.messages == 24
    assert info.size_bytes == bag.path.stat().st_size
    assert [(topic.name, topic.extent.messages, topic.interval_s) for topic in info.topics] == [
        ("/notes", 8, 3.0),
        ("/pressure", 8, 3.0),
        ("/robot/model", 8, 3.0),
    ]
    assert info.topics[1].size_bytes == 8 * len(number_message(0.0))
    text = shown(info_table(info))
    assert "24 messages in 23 s from 2026-05-28 20:26:40Z" in text
    assert "/robot/model" in text
    assert "whole" in text


@pytest.mark.parametrize("name", ["/a[/b]", "/a[link=http://evil.example]b", "/a\x1b]0;title\x07"])
def test_a_terminal_shows_names_of_topics_and_obeys_nothing_in_them(tmp_path, name):
    with BagWriter(tmp_path / "bag") as writer:
        topic = replace(NOTES, name=name, definition=replace(NOTES.definition, type_name=f"std_msgs/msg/{name}"))
        writer.write(topic, START_NS, START_NS, text_message("x"))
    for table in (
        info_table(bag_info(tmp_path / "bag")),
        recovery_table(recover_bag(tmp_path / "bag", tmp_path / "b")),
    ):
        console = Console(file=io.StringIO(), width=200, force_terminal=True, color_system=None)
        print_plain(console, table)
        text = console.file.getvalue()
        assert name.encode("unicode_escape").decode() in text
        assert "\x1b]" not in text


def test_a_bag_that_is_being_recorded_is_left_alone(tmp_path):
    with BagWriter(tmp_path / "run") as writer:
        writer.write(NOTES, START_NS, START_NS, text_message("x"))
        writer.flush()
        info = bag_info(tmp_path / "run")
    assert info.recording
    assert info.extent.messages == 1
    assert "being recorded now" in shown(info_table(info))


def test_gaps_are_found(tmp_path):
    with BagWriter(tmp_path / "run") as writer:
        for second in [*range(0, 200, 10), *range(500, 700, 10)]:
            writer.write(PRESSURE, START_NS + second * 10**9, START_NS, number_message(1.0))
    [topic] = bag_info(tmp_path / "run").topics
    [gap] = topic.gaps
    assert gap.duration_s == pytest.approx(310)
    assert gap.start_s == pytest.approx(START_NS * 1e-9 + 190)
    assert "1, longest 5 min 10 s at 20:29:50Z" in shown(info_table(bag_info(tmp_path / "run")))


@pytest.mark.parametrize(
    "times",
    [
        [0.0, 100.0],
        [0.1 * n for n in range(50)],
        [1.3**n for n in range(30)],
        [0.01 * n for n in range(50)] + [1.0 + 0.01 * n for n in range(50)],
    ],
    ids=["too few", "regular", "irregular", "short"],
)
def test_topics_without_gaps_have_none(times):
    assert find_gaps(times) == ()
