# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Requests of an operator: what is refused and why, and what the others do in a whole planner without ROS."""

import dataclasses
import math
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from test_mission_control import Around

from soilmoist_ros.exploration import ExplorerSettings, FieldAccess, Mission, Stop, VisitEnd, parse_dwell
from soilmoist_ros.exploration.control.operator_request import OperatorRequest, ReplyCode, RequestError, Requests
from soilmoist_ros.exploration.mission.events import AlarmOver, Command, Moved, Tick
from soilmoist_ros.exploration.mission.types import Alarm, MissionRules, Phase, Response, Verb
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.exploration.travel.travel import RobotMotion
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve

FRAME = LocalFrame(53.0, 0.0)
SQUARE = np.array([[0, 0], [20, 0], [20, 20], [0, 20]], float)
POND = np.array([[8, 8], [12, 8], [12, 12], [8, 12]], float)
FIELD = Field("square", FRAME, SQUARE, (POND,), 2.0)
MOTION = RobotMotion()
SETTINGS = ExplorerSettings(strategy="greedy", preset="paper", seed=0, motion=MOTION)
RULES = MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:30"))
FREE = FieldAccess(FIELD, MOTION, None)
NODES = (Stop("gate", 2.0, 2.0), Stop("well", 18.0, 2.0), Stop("oak", 18.0, 18.0))


def under_way(rules=RULES):
    mission = Mission(rules)
    for event in (Moved(1000.0, 1.0, 1.0), Command(1000.0, Verb.START), Tick(1360.0)):
        mission.step(event)
    return mission


def requests(**given):
    mission = under_way()
    return Requests(
        **{"field": FIELD, "access": FREE, "settings": SETTINGS, "rules": RULES, "state": mission.state, **given}
    )


def refused(code, *words, access=FREE, **given):
    with pytest.raises(RequestError) as caught:
        requests(access=access).command(OperatorRequest(**given), 0.0)
    assert caught.value.code is code
    for word in (*words, "->"):  # what is wrong, and the remedy
        assert word in str(caught.value)


@pytest.mark.parametrize("verb", ["measur", "", "MEASURE", "stop"])
def test_an_unknown_verb(verb):
    refused(ReplyCode.UNKNOWN_VERB, "there is no verb", "return_home", verb=verb)


@pytest.mark.parametrize(
    ("values", "word"),
    [
        ({}, "one place"),
        ({"place": (1.0, 2.0), "stops": ("r0c0",)}, "one place"),
        ({"stops": ("r0c0", "r1c1")}, "one place"),
        ({"place": (1.0,)}, "[x, y]"),
        ({"place": (1.0, 2.0, 3.0)}, "[x, y]"),
        ({"place": (math.nan, 2.0)}, "nan"),
        ({"place": (math.inf, 2.0)}, "inf"),
        ({"geographic_place": (53.0, math.nan)}, "latitude"),
        ({"geographic_place": (100.0, 10.0)}, "latitude"),
        ({"geographic_place": (54.0, 1.0)}, "outside the field"),
        ({"place": (10.0, 10.0)}, "no-go area"),
        ({"place": (25.0, 10.0)}, "5.0 m"),
    ],
)
def test_a_place_that_cannot_be_measured_at(values, word):
    refused(ReplyCode.BAD_PLACE, word, verb="measure", **values)


def test_a_place_is_measured_at_for_the_time_that_is_given():
    there = FRAME.to_geographic([(3.0, 4.0)])[0]
    for values in ({"place": (3.0, 4.0)}, {"geographic_place": tuple(there.tolist())}):
        command = requests().command(OperatorRequest("measure", "Ada ", dwell="120", **values), 7.0)
        assert (command.now_s, command.verb, command.who, command.dwell_s) == (7.0, Verb.MEASURE, "Ada", 120.0)
        assert (command.stop.x_m, command.stop.y_m) == pytest.approx((3.0, 4.0), abs=1e-3)
    named = requests().command(OperatorRequest("measure", stops=("r0c0",), dwell="fmi:90"), 0.0)
    assert (named.stop, named.dwell_s) == (FREE.stop("r0c0"), 90.0)
    assert requests().command(OperatorRequest("measure", stops=("r0c0",)), 0.0).dwell_s is None


def test_on_a_graph_places_are_nodes():
    graph = TravelGraph.from_edges(NODES, [*permutations(("gate", "well", "oak"), 2)])
    access = FieldAccess(FIELD, MOTION, graph)
    command = requests(access=access).command(OperatorRequest("measure", place=(17.0, 3.0)), 0.0)
    assert command.stop == NODES[1]
    refused(ReplyCode.BAD_PLACE, "well", "stops: [well]", access=access, verb="measure", place=(15.0, 7.0))
    refused(ReplyCode.UNKNOWN_STOP, "did you mean 'gate'", access=access, verb="measure", stops=("gat",))
    refused(ReplyCode.REFUSED, "map of the navigation", access=None, verb="measure", place=(1.0, 1.0))


@pytest.mark.parametrize("dwell", ["0", "-5", "nan", "99999", "often", "fmi:", "ami:0.02", "optimal"])
def test_a_dwell_that_a_single_stop_cannot_have(dwell):
    refused(ReplyCode.BAD_DWELL, verb="measure", place=(1.0, 1.0), dwell=dwell)


@pytest.mark.parametrize(
    ("polygon", "words"),
    [
        (((101.0, 1.0), (105.0, 1.0), (105.0, 9.0)), "the polygon lies 81 m from the field"),
        (((0.0, 53.0), (0.001, 53.0), (0.001, 53.001)), "degrees, longitude first: give metres east and north"),
        (((53.0, 0.0), (53.0, 0.001), (53.001, 0.001)), "degrees, latitude first: give metres east and north"),
        (((5.0, 5.0), (5.5, 5.0), (5.5, 5.5)), "0.12 m2, less than 1 m2"),
        (((501_000.0, 5_872_000.0), (501_009.0, 5_872_000.0), (501_009.0, 5_872_009.0)), "a map projection"),
    ],
)
def test_an_area_to_rule_out_is_judged_as_a_no_go_area_of_a_field_file(polygon, words):
    for access in (FREE, None):
        refused(ReplyCode.BAD_POLYGON, words, access=access, verb="rule_out", polygon=polygon)


def test_a_closed_polygon_is_as_good_as_an_open_one():
    corners = ((1.0, 1.0), (9.0, 1.0), (9.0, 9.0))
    for polygon in (corners, (*corners, corners[0])):
        assert requests().command(OperatorRequest("rule_out", polygon=polygon), 0.0).polygon == corners


def test_an_area_is_lifted_by_its_corners_as_a_page_has_rounded_them():
    area = ((1.004, 1.0), (9.0, 1.0), (9.0, 9.0))
    state = dataclasses.replace(under_way().state, ruled_out=(area,))
    shown = ((1.0, 1.0), *area[1:])
    assert requests(state=state).command(OperatorRequest("lift", polygon=shown), 0.0).polygon == area
    refused(ReplyCode.BAD_POLYGON, "none of the 0 ruled-out areas", verb="lift", polygon=shown)


def test_home_is_the_stop_nearest_to_a_place():
    request = OperatorRequest("change", place=(1.2, 0.7))
    assert requests().command(request, 0.0).changes.home == FREE.stop("r0c0")


@pytest.mark.parametrize(
    ("code", "values", "word"),
    [
        (ReplyCode.BAD_SETTING, {}, "nothing to change"),
        (ReplyCode.BAD_SETTING, {"hours": -1.0}, "above 0"),
        (ReplyCode.BAD_SETTING, {"hours": math.nan}, "above 0"),
        (ReplyCode.BAD_SETTING, {"hours": math.inf}, "above 0"),
        (ReplyCode.BAD_SETTING, {"until_gain": math.inf}, "above 0"),
        (ReplyCode.BAD_SETTING, {"until_sd": 5.0}, "not in percent: write 0.05"),
        (ReplyCode.BAD_SETTING, {"strategy": "gredy"}, "did you mean 'greedy'"),
        (ReplyCode.BAD_SETTING, {"target": "water"}, "rate, vwc"),
        (ReplyCode.BAD_SETTING, {"target": "vwc"}, "no calibration"),
        (ReplyCode.BAD_SETTING, {"target": "decision"}, "no thresholds"),
        (ReplyCode.BAD_DWELL, {"dwell": "often"}, "fmi"),
        (ReplyCode.UNKNOWN_STOP, {"home": "r0c99"}, "r0c9"),
        (ReplyCode.BAD_SETTING, {"hours": 2.0, "strategy": "none"}, "none"),
    ],
)
def test_a_setting_that_cannot_be_used(code, values, word):
    refused(code, word, verb="change", **values)


def test_settings_that_can_be_used():
    request = OperatorRequest("change", hours=2.0, dwell="ami:2.5%", strategy="random", target="vwc", home="r0c0")
    settings = replace(SETTINGS, calibration=CalibrationCurve(5.0, 1.4))
    changes = requests(settings=settings).command(request, 0.0).changes
    assert (changes.budget_s, changes.dwell, changes.strategy) == (7200.0, "ami:0.025", "random")
    assert (changes.target, changes.home, changes.warm_up_stops) == ("vwc", FREE.stop("r0c0"), 0)


# In a whole planner ------------------------------------------------------------------------------------------


def ask(around, verb, **values):
    return around.control.request(OperatorRequest(verb, "Ada", **values))


def test_the_shown_tour_leaves_out_an_area_at_once_and_has_it_again_when_it_is_lifted():
    around = Around(budget_s=3600.0)
    around.begin()
    ask(around, "measure", place=(15.0, 5.0))
    around.control._choice = dataclasses.replace(around.control._choice, ahead=(Stop("later", 5.0, 15.0),))
    area = ((3.0, 13.0), (7.0, 13.0), (7.0, 17.0), (3.0, 17.0))
    around.control.show()
    assert around.shown[-1][1][-1].name == "later"
    assert ask(around, "rule_out", polygon=area).accepted
    assert around.status.ruled_out == (area,)
    assert "later" not in [stop.name for stop in around.shown[-1][1]]
    assert ask(around, "lift", polygon=area).accepted
    around.control.show()
    assert around.shown[-1][1][-1].name == "later"


def measured(around):
    """Arrive, count, and go on to the next stop."""
    around.arrive()
    around.count()
    around.map()
    around.planned()


def test_a_requested_stop_comes_next_and_keeps_who_asked():
    around = Around(budget_s=3600.0)
    around.begin()
    reply = ask(around, "measure", place=(15.0, 5.0), dwell="20")
    assert reply.accepted
    assert around.status.queue == ("x15.0y5.0",)
    assert around.shown[-1][1][1] == Stop("x15.0y5.0", 15.0, 5.0), "it is shown among the stops ahead"
    measured(around)
    assert around.goals[-1][1] == Stop("x15.0y5.0", 15.0, 5.0)
    around.arrive()
    around.count(2)
    assert (around.visits[-1].reason, around.visits[-1].exposure_s) == ("requested by Ada", 20.0)
    around.map()
    around.planned()
    assert around.status.phase is Phase.TRAVELLING, "the mission chooses by itself again"


def test_changes_take_effect_at_the_next_plan():
    around = Around(budget_s=3600.0)
    around.begin()
    given = {"hours": 1.0, "dwell": "fmi:30", "strategy": "greedy", "home": "", "until_gain": 0.0}
    others = {"target": "rate", "until_sd": 0.0}
    assert around.control.settings == {**given, **others}
    given = {"hours": 1.5, "dwell": "fmi:20", "strategy": "gcb", "home": "r0c0", "until_gain": 0.1}
    assert ask(around, "change", **given).accepted
    assert around.control.settings == {**given, **others}
    assert around.status.time_left_s + around.status.time_used_s == 5400.0
    around.arrive()
    around.count(2)
    assert around.visits[-1].exposure_s == 20.0
    around.map()
    around.planned()
    assert "integrated" in around.status.reason or "variance" in around.status.reason
    assert around.control._planning._explorer[1].rules.home.name == "r0c0"
    assert ask(around, "return_home").accepted
    around.control.ended(Ended(around.goals[-1][0], Outcome.CANCELED, ""))
    assert around.status.phase is Phase.RETURNING
    assert around.goals[-1][1].name == "r0c0"
    around.arrive()
    assert "sent home by Ada" in around.finished.reason
    assert around.visits[-1].ended is VisitEnd.ENOUGH


def surveys(changes, settings):
    """Fields by name: half of the square, one elsewhere, one too small for the cells."""
    half = np.array([[0, 0], [10, 0], [10, 20], [0, 20]], float)
    shapes = {"half": (FRAME, half), "elsewhere": (LocalFrame(54.0, 0.0), half), "sliver": (FRAME, half / 1000)}
    if changes.earlier == ("gone",):
        raise InputError("there is no run gone", "choose another")
    frame, polygon = shapes[changes.field or "half"]
    return Field(changes.field or "half", frame, polygon, (), 2.0), replace(
        settings, seed=len(changes.earlier or ())
    )


def test_a_field_and_earlier_runs_are_chosen_between_missions():
    around = Around(budget_s=3600.0, surveys=surveys)
    around.ready()
    stops = len(around.control._access.stops)
    for wrong, words in (({"field": "elsewhere"}, "datum"), ({"earlier": ("gone",)}, "gone")):
        reply = ask(around, "change", **wrong)
        assert reply.code is ReplyCode.BAD_SETTING
        assert words in reply.message
    assert (len(around.control._access.stops), around.control.settings.get("field")) == (stops, None)
    assert ask(around, "change", field="half", hours=0.5).accepted
    assert ask(around, "change", earlier=("one", "two")).accepted
    assert len(around.control._access.stops) == stops / 2
    assert around.control._settings.seed == 2
    assert around.status.changes.of_survey == {"field": "half", "earlier": ("one", "two")}
    assert ask(around, "start").accepted
    around.planned()
    assert around.goals[-1][1].x_m < 10.0
    for survey in ({"field": "half"}, {"covariates": ()}):
        reply = ask(around, "change", **survey)
        assert reply.code is ReplyCode.REFUSED
        assert "a mission is under way" in reply.message
    assert ask(around, "change", hours=1.0).accepted
    assert around.status.changes.field == "half"
    assert ask(Around(), "change", field="half").code is ReplyCode.BAD_SETTING, "where no field can be opened"


def test_an_idle_mission_says_why_it_would_not_start():
    around = Around()
    around.ready()
    assert around.control.dangers == ""
    around.control.emergency(True, "/emergency_stop")
    around.control._feed.give(Alarm(1000.0, "battery", Response.RETURN, "the battery has 9 %"))
    assert around.status.reason.startswith("waiting for start, which is refused: the emergency stop is pressed")
    assert around.status.hindered
    around.control.emergency(False, "/emergency_stop")
    assert around.control.dangers == "the battery has 9 %"
    assert not around.control.command(Verb.START).accepted
    around.control._feed.give(AlarmOver(1001.0, "battery"))
    assert (around.status.reason, around.status.hindered) == ("waiting for start", False)
