# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests with bags."""

import pytest
from bags import Sample, fill

from soilmoist_ros.recording.bag.writer import BagWriter


@pytest.fixture
def bag(tmp_path):
    sample = Sample(tmp_path / "whole")
    with BagWriter(sample.folder) as writer:
        fill(writer, sample)
    return sample


@pytest.fixture
def unclosed(tmp_path):
    sample = Sample(tmp_path / "unclosed")
    writer = BagWriter(sample.folder)
    fill(writer, sample)
    writer.abandon()
    return sample
