# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("soilmoist_msgs")

from msg_adapters.soilmoist.visits import visit_from_message, visit_to_message
from soilmoist_ros.exploration.mission.types import Visit, VisitEnd
from soilmoist_ros.foundation.plain_values import foreign_text

places = st.floats(-5e4, 5e4)
stamps = st.integers(1, 2**31 - 2).map(float)
exposures = st.floats(0, 1e6)
texts = st.text(st.characters(exclude_categories=["Cs", "Cc"])).map(foreign_text)
visits = st.builds(
    Visit, name=texts, x_m=places, y_m=places, arrived_s=exposures, dwell_s=exposures,
    raw_counts=st.integers(0, 2**63), reason=texts, robot=st.integers(1, 9), records=st.integers(0, 2**32 - 1),
    exposure_s=exposures, effective_exposure_s=exposures, ended=st.sampled_from(VisitEnd), outcome=texts,
    dwell=texts,
    arrival_stamp_s=stamps, end_stamp_s=stamps, stop_x_m=places, stop_y_m=places,
)  # fmt: skip


@given(visits)
def test_a_visit_comes_back_exactly(visit):
    message = visit_to_message(visit, "robot_1")
    assert visit_from_message(message, visit.robot) == visit
    assert (message.robot, message.header.frame_id) == ("robot_1", "map")


def test_what_is_unknown_stays_unknown():
    visit = visit_from_message(visit_to_message(Visit("a", 1.0, 2.0, 3.0, 4.0, 5, "")))
    unknown = ("exposure_s", "effective_exposure_s", "arrival_stamp_s", "end_stamp_s", "stop_x_m", "stop_y_m")
    assert all(math.isnan(getattr(visit, name)) for name in unknown)


def test_codes_of_later_versions_are_read():
    message = visit_to_message(Visit("a", 1.0, 2.0, 3.0, 4.0, 5, ""))
    message.reason_code = "struck_by_lightning"
    assert visit_from_message(message).ended is VisitEnd.UNKNOWN
    with pytest.raises(ValueError, match="not a visit"):
        visit_from_message(message.header)


def test_control_characters_of_other_robots_do_not_come_in():
    odd = "no\x1b[31mrth\r\n\u202e5\x07"
    visit = Visit(name=odd, x_m=0.0, y_m=0.0, arrived_s=0.0, dwell_s=1.0, raw_counts=1, reason=odd, outcome=odd)
    found = visit_from_message(visit_to_message(visit))
    assert (found.name, found.reason, found.outcome) == ("north 5",) * 3
