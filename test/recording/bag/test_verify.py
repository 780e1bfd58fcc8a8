# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Bags are verified: what is not as it was recorded is named."""

import pytest
from bags import MODEL, START_NS, text_message

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.bag.verify import verify_bag
from soilmoist_ros.recording.bag.writer import BagWriter


def test_a_whole_bag_is_verified(bag):
    found = verify_bag(bag.folder)
    assert (found.checksums, found.problems) == (2, ())
    assert [file.extent.messages for file in found.files] == [24]
    assert verify_bag(bag.path).problems == ()


@pytest.mark.parametrize("place", [9, 300, -300, -3])
def test_a_flipped_bit_anywhere_is_found(bag, place):
    data = bytearray(bag.path.read_bytes())
    data[place] ^= 1
    bag.path.write_bytes(data)
    problem = "whole_0.mcap is not the file that was recorded: its checksum is another one"
    assert problem in verify_bag(bag.folder).problems


def test_what_the_metadata_say_is_compared(bag):
    path = bag.folder / "metadata.yaml"
    path.write_text(path.read_text().replace("message_count: 8", "message_count: 9", 1))
    (bag.folder / "SHA256SUMS").unlink()
    with BagWriter(bag.folder.with_name("other")) as writer:
        writer.write(MODEL, START_NS, START_NS, text_message("model"))
    writer.path.rename(bag.folder / "whole_1.mcap")
    assert verify_bag(bag.folder).problems == ("whole_1.mcap is not in metadata.yaml",)
    (bag.folder / "whole_1.mcap").unlink()
    assert verify_bag(bag.folder).problems == ("/robot/model has 8 messages, and metadata.yaml says 9",)
    path.unlink()
    assert verify_bag(bag.folder).problems == ("metadata.yaml is missing",)


def test_a_missing_file_and_a_bad_line_are_named(bag):
    with (bag.folder / "SHA256SUMS").open("a") as file:
        file.write(f"{'0' * 64}  whole_1.mcap\n{'0' * 64}  ../secret\nnonsense\n")
    problems = verify_bag(bag.folder).problems
    assert problems[0] == "whole_1.mcap is missing"
    assert len(problems) == 3
    with pytest.raises(InputError, match="no such bag"):
        verify_bag(bag.folder / "none")
