# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import dataclasses

import pytest

from soilmoist_ros.exploration.mission.state import MissionState, OpenVisit, replace


def test_fields_are_replaced_as_by_dataclasses():
    state = MissionState(now_s=3.0, raw_counts=7, counting=OpenVisit(1.0, 2.0, 0.0, 0.0, 0.0))
    changes = {"now_s": 4.0, "reason": "for a test"}
    assert replace(state, **changes) == dataclasses.replace(state, **changes)
    assert replace(state.counting, raw_counts=5) == dataclasses.replace(state.counting, raw_counts=5)
    assert state.now_s == 3.0


def test_an_unknown_field_is_refused():
    with pytest.raises(TypeError, match="MissionState has no colour"):
        replace(MissionState(), colour="red", now_s=1.0)
