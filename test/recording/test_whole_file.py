# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import os

import pytest

from soilmoist_ros.recording.run_folder import write_whole


def test_a_file_is_replaced_wholly(tmp_path):
    path = tmp_path / "state"
    write_whole(path, b"one")
    write_whole(path, b"two")
    assert path.read_bytes() == b"two"
    assert list(tmp_path.iterdir()) == [path]


def test_the_file_before_stays_if_the_new_one_does_not_reach_the_disk(tmp_path, monkeypatch):
    path = tmp_path / "state"
    write_whole(path, b"one")

    def full(descriptor):
        raise OSError("no space left")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="no space"):
        write_whole(path, b"two")
    assert path.read_bytes() == b"one"
