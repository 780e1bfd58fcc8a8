# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Missions that end when the map is good enough, or when a decision is made."""

from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.foundation import InputError
from soilmoist_ros.simulation import MissionSettings, achieved, simulate_mission, surrogate_field

UNIFORM = replace(surrogate_field("smooth"), name="uniform", truth=lambda xy: np.full(len(xy), 8.0))


def mission(**settings):
    result = simulate_mission(MissionSettings(**{"hours": 1.0, "cell_m": 4.0, "seed": 2, **settings}))
    return result, result.series[-1].time_s / 3600


@pytest.mark.slow
def test_a_map_that_is_good_enough_ends_the_mission():
    result, hours = mission(field="smooth", until_sd=0.07)
    assert "good enough" in result.ended
    assert hours < 0.8
    assert achieved(result.forecasts).forecast.sd == pytest.approx(0.07, abs=0.01)
    wet, _ = mission(field="patches", until="p95-sd=12%")
    assert "% by volume on 95 % of the field" in wet.ended
    with pytest.raises(InputError, match="both given -> give one of them"):
        mission(until="sd=2%", until_sd=0.02)


@pytest.mark.slow
def test_without_a_limit_forecasts_change_nothing():
    plain, _ = mission(field=UNIFORM, hours=0.5)
    assert plain.forecasts == ()
    result = simulate_mission(plain.settings, forecasts=True)
    assert result.series == plain.series
    asked, _ = mission(field=UNIFORM, hours=0.5, until="sd=0.0001% rate")
    assert result.series == asked.series
    assert "cannot be reached in the time" in asked.forecasts[0].forecast.text


@pytest.mark.slow
def test_a_mission_for_a_decision_counts_at_the_threshold_and_ends_when_it_is_made():
    settings = {"field": "ridge", "hours": 2.0, "target": "decision"}
    field = surrogate_field("ridge")
    rates = field.rate_at(field.field.grid(4.0).cells)
    limit = np.quantile(rates, 0.3)
    found, _ = mission(**settings, threshold=f"{limit}")
    plain, _ = mission(field="ridge", hours=2.0)
    away = [
        np.abs(field.rate_at(np.array([[one.x_m, one.y_m] for one in result.visits[40:]])) - limit).mean()
        for result in (found, plain)
    ]
    assert away[0] < 0.9 * away[1]
    forecasts = [one.forecast for one in found.forecasts]
    assert forecasts[0].wrong is None, "it explores first"
    assert forecasts[-1].wrong < 0.7 * next(one.wrong for one in forecasts if one.wrong is not None)
    outside, hours = mission(**{**settings, "hours": 0.5}, threshold="9")
    assert "9 counts/s is outside what the field has" in outside.forecasts[-1].forecast.text
    assert hours > 0.45, "nothing is decided by it"
    with pytest.raises(InputError, match="looks like a moisture"):
        mission(field="smooth", target="decision", threshold="0.2")
