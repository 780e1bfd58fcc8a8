# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Forecasts: in words and as text that comes back, and for fields without differences."""

import math
from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.exploration import Aim, Forecast, Property, Thresholds, forecast_from_text, forecast_to_text
from soilmoist_ros.exploration.planning import forecast as forecaster
from soilmoist_ros.exploration.planning.forecast import Forecaster, Reaching, map_forecast, prior_forecast
from soilmoist_ros.exploration.planning.properties import zones_right
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import EarlierSurvey, FieldGrid, FieldMap, Knowledge, Variogram
from soilmoist_ros.mapping.samples import as_samples
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

FORECAST = Forecast(0.0243, (1050.0, 2100.0), (0.022, 0.0199), (1.1, 1.2), 0.023, 4.0)
DONE = Forecast(0.0243, (), (), (), 0.023, 4.0)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({}, "±2.4 % of the rate now, ±2.0 % (1.7 to 2.4) in 35 min"),
        ({"moisture": True, "sd": 0.12}, "±12 % by volume now, ±2.0 % (1.7 to 2.4) in 35 min"),
        ({"times_s": (), "sds": (), "factors": ()}, "±2.4 % of the rate now"),
    ],
)  # fmt: skip
def test_a_forecast_in_words(changes, text):
    assert replace(FORECAST, **changes).text == text


REACHING = Reaching("p95-sd=0.03", True, 0.042, (0.031, 0.027, 0.036), (None, 900.0, None))


def test_when_an_aim_is_met_in_words():
    assert replace(FORECAST, reaching=REACHING).text == (
        f"{FORECAST.text}; ±3.0 % by volume on 95 % of the field probably not within the time: "
        "±3.1 % (2.7 to 3.6) at its end, 0.1 percentage points too much"
    )
    late = replace(REACHING, end=(0.031, 0.031, 0.031), times_s=(None, None, None))
    assert late.text == "±3.0 % by volume on 95 % of the field: missed, ±3.1 %, 0.1 percentage points too much"
    few = Reaching("zone=0.8", False, 0.7, (0.78371, 0.808, 0.767), (None, None, None))
    assert few.text == (
        "80 % of the zones right cannot be reached in the time: 78.4 % (76.7 to 80.8) at its end, "
        "1.6 percentage points too little"
    )
    zones = Reaching("zone=0.85", False, 0.7, (0.9, 0.92, 0.84), (1500.0, 900.0, None))
    assert zones.text == "85 % of the zones right in 25 min (15 to later than the time allows)"
    assert replace(zones, now=0.86).text == "85 % of the zones right: reached"
    assert replace(zones, now=0.86).met_text == "86.0 % of the zones right, 85 % demanded"


def test_only_a_map_tells_when_the_zones_are_right():
    early = prior_forecast(CELLS, 60.0, 4.0, 3600.0, aim=Aim("zone", 0.8)).reaching
    assert (early.text, early.is_met) == ("80 % of the zones right: when is not known yet", False)
    maker = Forecaster(CELLS, GRID.extent_m, 4.0)
    found = [maker.forecast(mapped(), used_s, 3600.0 - used_s, aim=Aim("zone", 0.99)) for used_s in (850.0, 950.0)]
    assert [len(one.reaching.times_s) for one in found] == [0, 3], "early it would be too optimistic"


def test_a_decision_is_not_made_by_thresholds_that_the_field_does_not_have():
    def told(*rates):
        return map_forecast(replace(mapped(), thresholds=Thresholds.of(rates, None)), CELLS, 3600.0)

    assert told(90.0).wrong < 0.01
    assert not told(90.0).is_decided
    assert told(90.0).text.endswith("; 90 counts/s is outside what the field has")
    assert replace(told(4.0, 90.0), wrong=0.0).is_decided
    assert replace(FORECAST, wrong=0.12, wrong_end=0.06).wrong_text.endswith(" 6.0 % (5.0 to 7.2) at the end")
    assert forecast_from_text(forecast_to_text(told(90.0))).divides is False


@pytest.mark.parametrize(
    ("text", "aim"),
    [
        ("p95-sd=0.02", Aim("p95-sd", 0.02)), (" SD = 2 %", Aim("sd", 0.02)), ("zone=85%", Aim("zone", 0.85)),
        ("sd=0.02 m³/m³", Aim("sd", 0.02, "vwc")), ("p95-sd=5% rate", Aim("p95-sd", 0.05, "rate")),
    ],
)  # fmt: skip
def test_an_aim_is_read_in_the_units_that_people_write(text, aim):
    assert Aim.parse(text) == aim
    assert Aim.parse(str(aim)) == aim


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("sd=2", "write sd=2%"), ("zone=0.2", "not between"), ("sd=", "not an aim"), ("0.02", "not an aim"),
        ("var=0.1", "no aim 'var' -> use one of"), ("zone=80% rate", "unit 'rate'"), ("sd=nan", "not an aim"),
        ("sd=2% m3/m3", "unit 'm3/m3'"), ("sd=1e", "not between"),
        ("zone=1", "not between 0.333 and 1 -> write for example"), ("sd=200%", "-> write for example"),
        ("zone=85", "write zone=85%"), ("sd=0,03", "write a decimal point: sd=0.03"),
    ],
)  # fmt: skip
def test_another_aim_is_refused(text, why):
    with pytest.raises(InputError, match=why):
        Aim.parse(text)


def test_moisture_is_aimed_at_where_the_sensor_is_calibrated():
    assert Aim.parse("sd=0.02").wants_moisture("rate", True)
    assert not Aim.parse("sd=0.02").wants_moisture("rate", False)
    assert not Aim.parse("sd=2% rate").wants_moisture("rate", True)
    with pytest.raises(InputError, match="needs a calibration"):
        Aim.parse("sd=0.02 m3/m3").wants_moisture("rate", False)


def test_zones_are_right_as_often_as_drawn():
    dice = np.random.default_rng(3)
    rate, before, after = dice.normal(4.0, 0.5, 60), np.full(60, 0.09), np.full(60, 0.03)
    limits = np.quantile(rate, [1 / 3, 2 / 3])
    mapped = rate + dice.normal(0, math.sqrt(0.06), (20000, 60))
    true = mapped + dice.normal(0, math.sqrt(0.03), mapped.shape)
    right = np.mean(np.searchsorted(limits, mapped) == np.searchsorted(limits, true))
    assert zones_right(rate, before, after) == pytest.approx(right, abs=0.005)
    assert zones_right(rate, before, before) < right < zones_right(rate, before, 0.1 * after)


@pytest.mark.parametrize("kind", ["sd", "p95-sd", "zone"])
def test_the_time_until_an_aim_is_that_of_the_curve(kind):
    of, left_s = mapped(), 3600.0
    now = map_forecast(of, CELLS, left_s, aim=Aim(kind, 0.9)).reaching
    demanded = (now.now + now.end[0]) / 2
    found = map_forecast(of, CELLS, left_s, aim=Aim(kind, demanded)).reaching
    when_s, soonest_s, latest_s = found.times_s
    assert not found.is_met
    assert 0 < soonest_s < when_s < min(latest_s or left_s, left_s)
    assert map_forecast(of, CELLS, when_s, aim=Aim(kind, demanded)).reaching.end[0] == pytest.approx(
        demanded, rel=0.01
    )
    if kind == "sd":
        assert found.now == pytest.approx(map_forecast(of, CELLS, left_s).sd)


@pytest.mark.parametrize(
    "forecast", [FORECAST, DONE, replace(FORECAST, wrong=0.06, moisture=True, reaching=REACHING), None]
)
def test_it_comes_back_from_text(forecast):
    assert forecast_from_text(forecast_to_text(forecast)) == forecast


@pytest.mark.parametrize("text", ["x", "{}", "[]", "null", '{"times_s":1,"sds":[],"factors":[]}'])
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError, match="not a forecast"):
        forecast_from_text(text)


# Forecasts of the map's standard deviation agree with kriging, and fall with the time left ----------------------

GRID = FieldGrid.from_polygon(np.array([[0, 0], [40, 0], [40, 20], [0, 20]], float), 4.0)
CELLS = GRID.cells
PLACES = np.array([(x, y) for x in (3.0, 11.0, 19.0, 27.0, 35.0) for y in (4.0, 16.0)])
CURVE = CalibrationCurve(n0_cps=7.0, bulk_density_gcm3=1.4)


def samples_of(rate, seed=0, exposure_s=100.0, places=PLACES):
    exposures = np.full(len(places), exposure_s)
    counts = np.random.default_rng(seed).poisson(np.broadcast_to(rate, len(places)) * exposures)
    return as_samples(places, counts, exposures)


def mapped(rate=4.0, variogram=None, curve=None, **more):
    samples, field_map = samples_of(rate, **more), FieldMap(GRID)
    fit = estimate_variogram(samples.xy, samples.counts, samples.exposure_s, extent_m=40.0)
    variogram = variogram or Variogram("matern32", 0.02, 9.0, 0.3)
    field_map.set_samples(samples, replace(fit, variogram=variogram, mean_rate=4.0))
    field_map.update()
    return Property(field_map, curve=curve)


def test_the_standard_deviation_now_is_that_of_the_map():
    of = mapped()
    variance = of.field_map.variance.mean() / of.field_map.rate.mean() ** 2
    assert map_forecast(of, CELLS, 3600.0).sd == pytest.approx(math.sqrt(variance), rel=1e-9)


def test_counts_spread_evenly_lower_it_as_kriging_says(monkeypatch):
    monkeypatch.setattr(forecaster, "EFFICIENCY", 1.0)
    monkeypatch.setattr(forecaster, "LEARNING", 0.0)
    of, left_s = mapped(), 1800.0
    kriging = of.field_map.kriging
    (rate, variance), covariance = kriging.predict(CELLS), kriging.covariance(CELLS)
    noise = np.diag(len(CELLS) * rate / left_s)
    left = covariance - covariance @ np.linalg.solve(covariance + noise, covariance)
    nugget = variance - np.diag(covariance)
    expected = math.sqrt(np.mean(np.diag(left) + nugget)) / rate.mean()
    assert map_forecast(of, CELLS, left_s).sd_end == pytest.approx(expected, rel=1e-8)


@pytest.mark.slow
def test_before_the_first_map_earlier_surveys_tell_more_than_the_guess():
    rate = 4.0 + 0.6 * np.sin(CELLS[:, 0] / 6.0)
    surveys = [EarlierSurvey(f"{day}", 86400.0 * day, samples_of(rate, day, 200.0, CELLS)) for day in range(4)]
    some = [FieldMap(GRID, knowledge=Knowledge(tuple(surveys[:count]))) for count in (1, 4)]
    guess, one, four = (
        Forecaster(CELLS, GRID.extent_m, 4.0).forecast(Property(field_map), 0.0, 600.0)
        for field_map in (FieldMap(GRID), *some)
    )
    assert guess.is_guess
    assert four.is_guess
    assert four.sd_end < 0.85 * one.sd_end
    assert one.mean_rate_cps == pytest.approx(surveys[0].samples.mean_rate_cps)


def test_forecasts_are_not_made_more_often_than_useful():
    of, maker = mapped(), Forecaster(CELLS, GRID.extent_m, 4.0)
    assert maker.forecast(of, 100.0, 3500.0) is not None
    assert maker.forecast(of, 130.0, 3470.0) is None
    assert maker.forecast(of, 160.0, 3440.0) is not None
    assert maker.forecast(of, 3600.0, 0.0) is None, "nothing is left to forecast"
    nothing = Property(FieldMap(GRID))
    assert Forecaster(CELLS, GRID.extent_m, 4.0).forecast(nothing, 0.0, 3600.0).is_guess
