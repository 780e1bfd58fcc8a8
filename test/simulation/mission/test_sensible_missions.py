# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""No silly behaviour: small and large fields, few and many counts, much time lost at stops."""

import math
from itertools import pairwise

import numpy as np
import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.simulation import MissionSettings, SurrogateField, simulate_mission


def field(side_m, rate_cps, cell_m=None):
    square = np.array([[0, 0], [side_m, 0], [side_m, side_m], [0, side_m]], float)
    grid = Field("square", LocalFrame(53.0, 0.0), square, (), cell_m or side_m / 15)
    return SurrogateField(
        "square", "square", grid, lambda xy: rate_cps * (1 + 0.2 * np.sin(4 * xy[:, 0] / side_m))
    )


SMALL = field(15.0, 3.0)
CASES = {
    "15 m": {"field": SMALL, "hours": 0.4}, "100 ha": {"field": field(1000.0, 3.0), "hours": 0.8},
    "0.05 counts/s": {"field": field(60.0, 0.05), "hours": 0.5},
    "100 counts/s": {"field": field(60.0, 100.0), "hours": 0.3},
    "long records": {"field": field(60.0, 3.0), "hours": 0.5, "cadence_s": 30.0},
    "at least 45 s": {"field": field(60.0, 3.0), "hours": 0.4, "min_dwell_s": 45.0},
    "graph": {"field": field(60.0, 3.0), "hours": 0.4, "travel": "graph"},
    "ivr": {"field": SMALL, "hours": 0.3, "strategy": "ivr"},
    "random": {"field": field(60.0, 3.0), "hours": 0.3, "strategy": "random", "dwell": "ami:0.1"},
    "lattice": {"field": field(60.0, 3.0), "hours": 0.4, "strategy": "lattice", "dwell": "fmi:33"},
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_mission_makes_sense(case):
    given = MissionSettings(**{"series_every_s": 600.0, **CASES[case]})
    result = simulate_mission(given)
    budget_s, record_s = 3600 * given.hours, given.cadence_s
    stops = [(visit.stop_x_m, visit.stop_y_m) for visit in result.visits]
    assert len(stops) >= 2
    assert all(one != other for one, other in pairwise(stops)), "a goal to the node under the wheels"
    assert len([line for line in result.log if "go to" in line]) <= len(stops), "nothing is counted at a stop"
    assert result.series[-1].time_s == budget_s, "the time is used up"
    last = result.visits[-1]
    assert last.arrived_s + last.dwell_s == pytest.approx(budget_s, abs=1e-6), "an idle tail"
    for visit in result.visits[:-1]:
        assert visit.exposure_s >= (given.min_dwell_s or record_s) * (1 - 1e-9)
        assert visit.records >= 1
    assert result.series[-1].counting_s <= budget_s
    assert math.isfinite(result.series[-1].mse)
