# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros.mapping.knowledge.earlier import EarlierSurvey
from soilmoist_ros.mapping.samples.samples import Samples
from soilmoist_ros.pipeline.earlier_runs import earlier_doubts, mean_rate
from soilmoist_ros.pipeline.run import EarlierRun

NOW = datetime(2026, 6, 1, tzinfo=UTC)


def run(stamp_s: float, rate_cps: float = 4.0) -> EarlierRun:
    samples = Samples(np.array([[0.0, 0.0], [5.0, 5.0]]), np.full(2, 100 * rate_cps), np.full(2, 100.0))
    return EarlierRun(EarlierSurvey("may", stamp_s, samples), Path("may"), stamp_s - 60, [])


@pytest.mark.parametrize(
    ("date", "rate_cps", "said"),
    [
        (datetime(2026, 5, 1, tzinfo=UTC), 4.0, []),
        (datetime(2026, 5, 1, tzinfo=UTC), 2.1, []),
        (datetime(2026, 5, 1, tzinfo=UTC), 1.9, ["has 0.47 times the count rate of this one"]),
        (datetime(2026, 6, 2, tzinfo=UTC), 4.0, []),  # a local clock
        (datetime(2027, 1, 1, tzinfo=UTC), 4.0, ["is dated 2027-01-01, in the future"]),
        (datetime(2020, 5, 1, tzinfo=UTC), 9.0, ["of 2020-05-01 lies 6 years", "has 2.2 times"]),
        (datetime(1970, 1, 1, tzinfo=UTC), 4.0, []),  # a clock without a date
    ],
)
def test_dates_and_rates_that_can_hardly_be_right(date, rate_cps, said):
    found = list(earlier_doubts(run(date.timestamp(), rate_cps), 4.0, NOW, NOW))
    assert len(found) == len(said)
    assert all(one.startswith(start) for one, start in zip(found, said, strict=True))


def test_of_a_season_no_survey_is_too_old():
    assert not list(earlier_doubts(run(datetime(2001, 5, 1, tzinfo=UTC).timestamp()), 4.0, NOW))
    (doubt,) = earlier_doubts(run(datetime(2026, 5, 1, tzinfo=UTC).timestamp(), 40.0), 4.0, NOW)
    assert doubt.startswith("has 10 times the count rate of the others")


def test_the_mean_rate_is_that_of_all_counts():
    samples = Samples(np.array([[0.0, 0.0], [9.0, 0.0]]), np.array([10.0, 90.0]), np.array([10.0, 20.0]))
    assert mean_rate(samples) == pytest.approx(100 / 30)
