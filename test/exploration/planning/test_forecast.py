# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A forecast in words and as text that comes back."""

from dataclasses import replace

import pytest

from soilmoist_ros.exploration.planning.forecast import Forecast, forecast_from_text, forecast_to_text

FORECAST = Forecast(0.0243, (1050.0, 2100.0), (0.022, 0.0199), (1.1, 1.2), 0.023, 4.0)
DONE = Forecast(0.0243, (), (), (), 0.023, 4.0)


def test_a_forecast_in_words():
    assert FORECAST.text == "±2.4 % of the rate now, ±2.0 % (1.7 to 2.4) in 35 min"
    assert replace(FORECAST, moisture=True, sd=0.12).text == "±12 % by volume now, ±2.0 % (1.7 to 2.4) in 35 min"
    assert replace(FORECAST, hidden=0.06).text.endswith(
        "; the counts show no differences, and the rate varies by less than ±6 %"
    )
    assert DONE.text == "±2.4 % of the rate now"


def test_what_is_derived():
    assert FORECAST.gain == pytest.approx(1 - 230 / 243)
    assert FORECAST.band_end == pytest.approx((0.0199 / 1.2, 0.0199 * 1.2))
    assert [FORECAST.at(time_s) for time_s in (0.0, 1050.0, 2100.0, 9999.0)] == [0.0243, 0.022, 0.0199, 0.0199]
    assert (DONE.sd_end, DONE.band_end) == (0.0243, (0.0243, 0.0243))
    assert replace(DONE, sd=0.0).gain == 0.0


@pytest.mark.parametrize("forecast", [FORECAST, DONE, replace(FORECAST, hidden=0.06, moisture=True), None])
def test_it_comes_back_from_text(forecast):
    assert forecast_from_text(forecast_to_text(forecast)) == forecast


@pytest.mark.parametrize("text", ["x", "{}", "[]", "null", '{"times_s":1,"sds":[],"factors":[]}'])
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError, match="not a forecast"):
        forecast_from_text(text)
