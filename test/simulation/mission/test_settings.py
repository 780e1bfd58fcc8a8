# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Settings of a mission and their declaration: settings.py."""

import dataclasses
import math
from itertools import pairwise

import click
import numpy as np
import pytest

from soilmoist_ros.cli.main import main
from soilmoist_ros.exploration.planning.dwell import FixedInterval
from soilmoist_ros.exploration.strategies.strategy import Choice
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.lab.campaign_file import Choices
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.simulation import (
    SETTINGS,
    MissionSettings,
    PropertySettings,
    SurrogateField,
    simulate_mission,
    surrogate_field,
)

NAMES = [item.name for item in dataclasses.fields(MissionSettings)]


@pytest.mark.parametrize("name", NAMES)
def test_a_setting_is_declared_once_and_is_an_option_a_key_and_a_column(name):
    setting = SETTINGS[name]
    command = main.get_command(click.Context(main), "simulate")
    (option,) = [one for one in command.params if one.name == name]
    assert setting.option in (*option.opts, *option.secondary_opts)
    assert setting.help.split(". ")[0].rstrip(".") in option.help
    assert name in MissionSettings().as_texts()
    assert name in MissionSettings().as_dict()
    if name != "seed":  # a campaign has runs
        assert Choices.model_fields[name].description == setting.help


def test_what_is_not_given_is_as_the_preset_has_it_and_what_is_given_wins():
    recommended = MissionSettings()
    assert (recommended.strategy, recommended.dwell, recommended.model) == ("gcb", "optimal", "matern32")
    assert (recommended.fit, recommended.map_from) == ("reml", "records")
    for preset in ("paper", "authors"):
        published = MissionSettings(preset=preset)
        assert (published.strategy, published.dwell, published.model) == ("greedy", "ami:0.03", "gaussian")
        assert (published.fit, published.map_from) == ("soft_l1", "stops")
    assert MissionSettings(preset="paper", fit="reml").fit == "reml"
    assert MissionSettings(preset="paper", fit="reml").model == "gaussian"


def test_equality_is_that_of_the_missions():
    assert MissionSettings() == MissionSettings(strategy="gcb", map_from="records")
    assert MissionSettings(properties=("rough",)) == MissionSettings(properties=(PropertySettings("rough"),))
    assert MissionSettings(preset="paper") != MissionSettings(preset="authors")


def test_every_mistake_is_named_at_once():
    with pytest.raises(InputError) as caught:
        MissionSettings(hours=-1, robots=0, graph="map.yaml").check()
    assert len(caught.value.mistakes) == 3


@pytest.mark.parametrize(
    ("text", "field", "weight"),
    [
        ("rough", "rough", 1.0),
        ("rough:0", "rough", 0.0),
        ("./fields/salt.yaml:0.25", "./fields/salt.yaml", 0.25),
        ("C:/fields/salt.yaml", "C:/fields/salt.yaml", 1.0),
        ("C:\\fields\\salt.yaml:2", "C:\\fields\\salt.yaml", 2.0),
    ],
)
def test_a_property_is_a_field_with_a_weight(text, field, weight):
    found = PropertySettings.parse(text)
    assert (found.field, found.weight) == (field, weight)
    assert PropertySettings.parse(str(found)) == found


@pytest.mark.parametrize("text", ["", ":1", "rough:", "rough:-1", "rough:nan", "rough:inf", "rough:much"])
def test_a_text_without_field_or_weight_is_refused(text):
    with pytest.raises(InputError, match="is not a property with a weight"):
        PropertySettings.parse(text)


def test_a_text_of_settings_has_what_differs_from_the_preset():
    assert str(MissionSettings()) == "field=synthetic-high strategy=gcb dwell=optimal seed=1"
    text = str(MissionSettings(preset="paper", hours=1.0, properties=("rough:2",)))
    assert text == "field=synthetic-high strategy=greedy dwell=ami:0.03 hours=1.0 seed=1 properties=rough:2"


class First:
    """Chooses the first candidate that can be reached."""

    def choose(self, situation, rng):
        near = np.flatnonzero(np.isfinite(situation.travel_s))
        return Choice(situation.candidates[near[0]], "the first") if len(near) else None


@pytest.mark.slow
@pytest.mark.parametrize("strategy", [First, First()])
def test_a_strategy_and_a_dwell_rule_may_be_objects(strategy):
    settings = MissionSettings(strategy=strategy, dwell=FixedInterval(60.0), hours=0.25, cell_m=8.0)
    result = simulate_mission(settings)
    assert "the first" in {visit.reason for visit in result.visits}
    assert {visit.dwell for visit in result.visits} == {"fmi:60"}
    assert (settings.as_dict()["strategy"], settings.as_dict()["dwell"]) == ("First", "fmi:60")
    assert "strategy=First dwell=fmi:60" in str(settings)


def test_a_field_may_be_an_object():
    named = MissionSettings(field="patches", properties=["rough:0.5"], hours=0.1)
    given = MissionSettings(
        field=surrogate_field("patches"), properties=[PropertySettings(surrogate_field("rough"), 0.5)], hours=0.1
    )
    assert given.as_dict() == named.as_dict()
    assert str(given) == str(named)
    with pytest.raises(InputError, match="'patches' is given as it is"):
        simulate_mission(dataclasses.replace(given, random_field=True))


@pytest.mark.parametrize(("given", "write"), [(5.0, "0.05"), (2, "0.02"), (0.6, "0.006")])
def test_an_end_in_percent_is_refused_with_the_share_to_write(given, write):
    with pytest.raises(InputError, match=f"until_sd: must be at most 0.5, but it is .* -> write {write}$"):
        MissionSettings(until_sd=given).check()
    MissionSettings(until_sd=0.05).check()


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("hours", 0, "must be > 0"),
        ("hours", math.inf, "must be finite"),
        ("hours", 10**400, "must be finite"),
        ("hours", True, "must be a number"),
        ("seed", -1, "must be >= 0"),
        ("robots", 1.5, "must be a whole number"),
        ("footprint_m", -0.1, "must be >= 0"),
        ("strategy", "gredy", "did you mean 'greedy'"),
        ("model", "matern23", "did you mean 'matern"),
        ("dwell", "ami:3", "did you mean 'ami:3%'"),
        ("weather", 1, "must be true or false"),
        ("field", "", "must not be empty"),
        ("preset", "papers", "did you mean 'paper'"),
        ("persistence", 1.5, "must be at most 1"),
        ("covariate_correlation", -1.5, "must be >= -1"),
    ],
)
def test_a_value_that_is_not_allowed_is_named(name, value, message):
    with pytest.raises(InputError, match=f"{name}: .*{message}"):
        MissionSettings(**{name: value}).check()


def test_a_decimal_comma_is_named():
    with pytest.raises(ValueError, match=r"must be a number, but it is '0,5' -> write 0\.5"):
        SETTINGS["hours"].parsed("0,5")


# Sensible missions ---------------------------------------------------------------------------------------------


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
    "optimal": {"field": SMALL, "hours": 0.3, "strategy": "greedy", "dwell": "optimal"},
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
