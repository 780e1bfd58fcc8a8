# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.reporting.page.viewer.packing import unpack, unpack_bits
from soilmoist_ros.reporting.season.season_page import mean_chart, render_season, season_data

pytestmark = pytest.mark.slow


def test_the_page_asks_for_nothing_from_elsewhere_and_names_every_survey(season):
    page = render_season(season)
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", page)
    for name in ("survey_1", "survey_2", "run"):
        assert f">{name}<" in page
    assert 'type="range"' in page
    assert "SIMULATED DATA" in page


def test_layers_have_a_map_of_every_survey_in_one_scale(season):
    data = season_data(season)
    assert [layer["key"] for layer in data["layers"]] == ["vwc", "rate", "change", "sd"]
    shape = (data["grid"]["ny"], data["grid"]["nx"])
    for layer in data["layers"]:
        assert len(layer["maps"]) == 3
        assert layer["from"] < layer["to"]
    moisture = unpack(data["layers"][0]["maps"][1], shape)
    np.testing.assert_allclose(moisture, 100 * season.surveys[1].bands.vwc, atol=0.01)
    change = data["layers"][2]
    assert np.isnan(unpack(change["maps"][0], shape)).all()
    unsure = unpack_bits(change["hatch"][1], shape)
    np.testing.assert_array_equal(unsure, season.surveys[1].change.significant == 0)


def test_without_a_calibration_the_page_shows_the_rate(season):
    bare = replace(season, curve=None, surveys=[replace(one, mean_vwc=None) for one in season.surveys])
    assert [layer["key"] for layer in season_data(bare)["layers"]] == ["rate", "change", "sd"]
    assert "mean rate" in mean_chart(bare).y_label
    assert "counts/s" in render_season(bare)


def test_the_chart_shows_every_mean_with_its_interval(season):
    area, line, dots = mean_chart(season).marks
    assert len(dots.x) == 3
    assert (np.asarray(area.low) < np.asarray(line.y)).all()
    assert line.y[0] == pytest.approx(100 * season.surveys[0].mean_vwc.value)


def test_colours_of_the_change_are_as_the_page_says(season):
    """Drier is the first colour of a change of the moisture: brown; the help must say so."""
    change = season_data(season)["layers"][2]
    red, green, blue = (int(change["colours"][0][at : at + 2], 16) for at in (1, 3, 5))
    assert red > green > blue, "brown"
    assert "In the change, brown is drier and green wetter." in render_season(season)


def test_moisture_has_its_rate_in_brackets_and_the_map_comes_first(season):
    page = render_season(season)
    assert f"[{season.surveys[0].mean_rate.value:.3f} counts/s]" in page
    assert page.index('id="season-map"') < page.index('class="lead"') < page.index('id="surveys"')
    assert str(season.surveys[0].run.path.parent) not in page


def test_surveys_have_their_end_in_utc_and_in_the_time_of_the_field(season):
    def dated(one):
        survey = replace(one.run.survey, stamp_s=one.run.survey.stamp_s + 1.75e9)  # 15:06:40 UTC and the mission
        return replace(one, run=replace(one.run, survey=survey))

    there = replace(season, surveys=[dated(one) for one in season.surveys], time_zone="Australia/Sydney")
    page = render_season(there)
    assert re.search(r"<td>15:\d\d UTC, 2025-06-1\d 01:\d\d Australia/Sydney</td>", page)
    assert re.search(r"<td>15:\d\d UTC</td>", render_season(replace(there, time_zone="")))
    assert "UTC</td>" not in render_season(season)


def test_a_guessed_calibration_is_named(season):
    guessed = replace(season, illustrative=True)
    assert season_data(guessed)["layers"][0]["unit"] == "% by volume, illustrative"
