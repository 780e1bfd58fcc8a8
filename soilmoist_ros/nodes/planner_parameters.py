# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the planner, and the settings of mission, watch and team that are made of them."""

from __future__ import annotations

import math
from typing import Any, Final

from soilmoist_ros.exploration import (
    FAILSAFES,
    LIMITS,
    MAX_UNTIL_SD,
    PERSON_ENTRY_M,
    POSES_FROZEN_S,
    PUBLISHED_MIN_LAST_DWELL_S,
    ROBOT_RADIUS_M,
    AccessRules,
    Aim,
    Cause,
    Changes,
    ExplorerSettings,
    MissionRules,
    Outside,
    Response,
    RobotMotion,
    Team,
    Watch,
    WatchLimits,
    check_places,
    chosen_response,
    keep_apart_m,
    make_strategy,
    parse_dwell,
    person_rules,
    person_watch,
)
from soilmoist_ros.foundation import InputError, did_you_mean, resource
from soilmoist_ros.mapping import CovariateSource, Field, FieldMapSettings, Knowledge, load_field, read_covariates
from soilmoist_ros.nodes.parameter_tables import COVARIATES, EARLIER, of_setting, row
from soilmoist_ros.nodes.parameters import SILENCE_S, Parameters
from soilmoist_ros.pipeline import EarlierTarget, planning_curve, planning_thresholds, read_earlier_runs
from soilmoist_ros.sensing import MoistureCurve, PlaceLimits, Site, load_site

PERSON: Final = "person"  # navigator of a person: no navigation is needed, and nothing stops the person
_PLACE = PlaceLimits()
_FASTER: Final = 2.0  # highest speed as a multiple of the robot's usual one, where it is not given


WATCH_PARAMETERS: Final = (
    row("failsafes", [], "responses to causes where they are not the default ones of docs/safety.md, as "
        f"CAUSE:RESPONSE, such as off_route:pause; responses are {', '.join(Response)}"),
    *(
        row(name, getattr(WatchLimits, name), about, unit, 0.0, None if unit else 1.0)
        for name, (unit, about) in LIMITS.items()
    ),
    row("max_speed_mps", 0.0,
        f"highest speed of the robot; 0 for {_PLACE.max_speed_mps:g} m/s, or twice speed_mps if that is more",
        "m/s", 0),
    row("max_fix_sd_m", _PLACE.max_sd_m, "fixes with a larger standard deviation are not used", "m", 0),
)  # fmt: skip

PARAMETERS: Final = (
    row("field", "", "field file, or name of a shipped one", live=True),
    of_setting("strategy", description="how the next stop is chosen", live=True),
    of_setting("preset", description="constants of the strategies"),
    of_setting("seed", default=0, description="seed of the strategies' randomness"),
    of_setting("dwell", description="time at a stop: fmi:SECONDS, ami:THRESHOLD or optimal", live=True),
    of_setting("target", live=True),
    of_setting("threshold", default=""),
    row("site", "", "site file with the calibration, or name of a shipped one; for target vwc"),
    of_setting("hours", description="time of the mission, the way home and pauses included", low=0.01,
        live=True),
    of_setting("until"),
    of_setting("until_sd", high=MAX_UNTIL_SD, live=True),
    of_setting("until_gain", live=True),
    of_setting("certify"),
    row("others", [], "namespaces of other robots whose planners explore the same field: where one is going or "
        "counting, this one does not go; the own namespace is ignored"),
    row("properties", [], "namespaces in which further properties of the field are mapped, as NAMESPACE or "
        "NAMESPACE:WEIGHT; the robot's own property has the weight 1; a property without a map is left out"),
    EARLIER,
    COVARIATES,
    row("home", "", "stop to return to at the end; the robot stays where it is if empty", live=True),
    row("graph", "topic", "where the robot may drive: topic (the navigation's map), free (straight lines), or a "
        "file: a topological map, or tracks as lines in GeoJSON, GPX, KML or a shapefile"),
    row("lanes", False, "whether a car drives, which turns around only at ends and junctions of the graph"),
    row("map_topic", "/topological_map_2", "topic of the navigation's map"),
    row("robot_properties", [], "what this robot is, for the restrictions of the navigation's map, such as "
        "robot_short; nodes and edges whose restriction is not surely met are not used"),
    row("robot_radius_m", ROBOT_RADIUS_M, "distance that the robot's centre keeps from no-go areas and, with "
        "graph: free, from the border; the default is half the width of Thorvald, 0 keeps none", "m", 0.0),
    row("outside", "home", "use of the map's nodes and edges outside the field, which are never measured at and "
        "never cross a no-go area: never, only the shortest way between the field and home or robot (home), or "
        "as any other (way)", choices=tuple(Outside)),
    row("keepout_topic", "", "topic on which the fence is published as a keep-out mask for Nav2, with "
        "costmap_filter_info, if any"),
    row("navigator", "goto_node", "how goals are sent: to the nodes of a topological map (goto_node), to Nav2 "
        "(navigate_to_pose), along routes of Nav2's Route Server that the fence allows (follow_route), as poses "
        "without any answer (goal_pose: a stop is then only a pose where the robot is), or shown to a person "
        "with the sensor on the operator's page (person)",
        choices=("goto_node", "navigate_to_pose", "follow_route", "goal_pose", PERSON)),
    row("action_name", "", "name of the navigation's action; empty for topological_navigation (goto_node), "
        "navigate_to_pose, or compute_and_track_route (follow_route; follow_path is next to it)"),
    row("action_type", "", "type of the navigation's action; empty for "
        "topological_navigation_msgs/action/GotoNode (goto_node), nav2_msgs/action/NavigateToPose, or "
        "nav2_msgs/action/ComputeAndTrackRoute (follow_route)"),
    row("frame", "map", "frame of plan, markers, visits and records: east, north, up about the field's datum"),
    row("navigation_frame", "", "frame of the navigation's map and goals; empty if it is the same as frame"),
    row("navigation_datum", "field", "origin of the navigation's frame: field (the field's datum), "
        "LAT,LON[,YAW] in degrees (YAW: its x axis, counter-clockwise from east), map (named in the "
        "navigation's map), or robot (TF and fixes of a drive by hand)"),
    row("base_frame", "base_link", "frame of the robot's base in TF"),
    row("antenna_x_m", 0.0, "GNSS antenna, forward of the base frame's origin", "m", -50.0, 50.0),
    row("antenna_y_m", 0.0, "GNSS antenna, to the left of the base frame's origin", "m", -50.0, 50.0),
    of_setting("speed_mps", description="speed of the robot, to estimate times", low=0.01),
    of_setting("stop_overhead_s"),
    of_setting("metre_cost_s"),
    row("arrival_radius_m", 3.0, "the robot is at a stop within this distance, and within half of that to the "
        "nearest other node", "m", 0.01),
    row("return_margin_s", 60.0, "reserve kept for the way home", "s", 0.0),
    row("min_dwell_s", 10.0, "shortest time at a stop, whatever the dwell rule says, by default one record; "
        "stops that leave less are skipped", "s", 0.0),
    row("start_delay_s", 0.0, "time from the warning on the topic about_to_move, for a horn or beacon, to the "
        "first motion after a start, a pause or a hold; 0 for no warning", "s", 0.0, 60.0),
    row("autostart", False, "start the mission as soon as position, map and navigation are there"),
    row("journal_dir", "", "folder of the mission's journal, to survive a crash; no journal if empty"),
    row("resume", "ask", "what to do with an interrupted mission: wait for resume or abort, resume it, or "
        "forget it", choices=("ask", "auto", "fresh")),
    *WATCH_PARAMETERS,
    row("respawn_limit_s", 0.0, "a planner that crashed less than this ago resumes by itself, unless the "
        "mission was paused or crashes again and again; 0 to do as resume says", "s", 0.0),
    row("exit_when_finished", False, "end the process with the mission, for simulations"),
)  # fmt: skip

CANCEL_LIMIT_S: Final = 10.0
"""Time after which a robot that is not known to stand is asked again to stop [s]: a lost request costs no more."""
RECORD_S: Final = 10.0
"""Usual duration of a record [s]; one that is counted wholly at a stop may begin this long after the arrival."""


def explorer_settings(parameters: Parameters, field: Field) -> ExplorerSettings:
    """Settings for the choice of stops."""
    text, number = parameters.text, parameters.number
    make_strategy(text("strategy"), text("preset"))
    check_places(parameters.whole("certify"))
    site, target = load_site(text("site")) if text("site") else Site(), text("target")
    calibration = planning_curve(site, field, target == "vwc")
    of_moisture, aim = target != "rate", wanted(parameters)
    if aim is not None:
        of_moisture = aim.wants_moisture(target, calibration is not None)
    return ExplorerSettings(
        strategy=text("strategy"),
        preset=text("preset"),
        seed=parameters.whole("seed"),
        motion=RobotMotion(number("speed_mps"), number("stop_overhead_s"), number("metre_cost_s")),
        curve=calibration if of_moisture else None,
        calibration=calibration,
        thresholds=planning_thresholds(target, text("threshold"), site, calibration),
        knowledge=_knowledge(parameters, field, site.curve),
        certify=parameters.whole("certify"),
        access=AccessRules(
            robot_radius_m=number("robot_radius_m"),
            outside=Outside(text("outside")),
            entry_m=PERSON_ENTRY_M
            if text("navigator") == PERSON
            else max(number("max_entry_m"), number("max_outside_m")),
            by_name=text("navigator") == "goto_node",
            lanes=parameters.flag("lanes"),
        ),
    )


def chosen_survey(parameters: Parameters, changes: Changes | None) -> tuple[Field, ExplorerSettings]:
    """The field and the settings, with the field, earlier runs and covariates that an operator has chosen."""
    chosen = changes.of_survey if changes is not None else {}
    values = parameters.changed({name: one if isinstance(one, str) else list(one) for name, one in chosen.items()})
    field = load_field(resource("fields", values.text("field")))
    return field, explorer_settings(values, field)


def _knowledge(parameters: Parameters, field: Field, calibration: MoistureCurve | None) -> Knowledge:
    """Knowledge of the robot's own property: earlier surveys and covariates, as the mapper has them."""
    paths = parameters.texts("earlier")
    sources = (*field.covariates, *map(CovariateSource.parse, parameters.texts("covariates")))
    if not (paths or sources):
        return Knowledge()
    target = EarlierTarget(field.frame, field.grid(), FieldMapSettings(curve=calibration))
    runs = read_earlier_runs(paths, target) if paths else ()
    return Knowledge(tuple(run.survey for run in runs), read_covariates(sources, field.frame, target.grid))


def make_team(parameters: Parameters) -> Team:
    """Team of the other robots on the field."""
    return Team(keep_apart_m(parameters.number("robot_radius_m")))


def wanted(parameters: Parameters) -> Aim | None:
    """Quality that the map must have; ``None`` if the time decides."""
    aim = Aim.parse(parameters.text("until")) if parameters.text("until") else None
    if aim is not None and parameters.number("until_sd") > 0:
        raise InputError("until and until_sd are both given", "give one of them")
    return aim


def mission_rules(parameters: Parameters, settings: ExplorerSettings) -> MissionRules:
    """Rules of the mission."""
    number = parameters.number
    recommended = settings.preset == "recommended"
    rules = MissionRules(
        budget_s=number("hours") * 3600, dwell=parse_dwell(parameters.text("dwell")),
        warm_up_stops=settings.warm_up_stops, min_dwell_s=number("min_dwell_s"),
        min_last_dwell_s=number("min_dwell_s") + RECORD_S if recommended else PUBLISHED_MIN_LAST_DWELL_S,
        stays=recommended, speed_mps=settings.motion.speed_mps, stop_overhead_s=settings.motion.stop_overhead_s,
        arrival_radius_m=number("arrival_radius_m"), return_margin_s=number("return_margin_s"),
        cancel_limit_s=CANCEL_LIMIT_S, silence_limit_s=number("records_old_s") or SILENCE_S,
        until_sd=number("until_sd"), until_gain=number("until_gain"), until=wanted(parameters),
        antenna_m=math.hypot(number("antenna_x_m"), number("antenna_y_m")),
    )  # fmt: skip
    return person_rules(rules) if parameters.text("navigator") == PERSON else rules


def failsafe_responses(parameters: Parameters) -> dict[Cause, Response]:
    """Response to each cause."""
    responses = {cause: failsafe.response for cause, failsafe in FAILSAFES.items()}
    for text in parameters.texts("failsafes"):
        cause, _, response = (part.strip() for part in text.partition(":"))
        for name, known in ((cause, list(Cause)), (response, list(Response))):
            if name not in known:
                remedy = f"write CAUSE:RESPONSE{did_you_mean(name, known)}; known are {', '.join(known)}"
                raise InputError(f"failsafes: {text!r} has the unknown {name!r}", remedy)
        responses[Cause(cause)] = chosen_response(Cause(cause), Response(response))
    return responses


def make_watch(parameters: Parameters) -> Watch:
    """The watch of a planner."""
    number, usual_mps = parameters.number, parameters.number("speed_mps")
    speed_mps = number("max_speed_mps") or max(_PLACE.max_speed_mps, _FASTER * usual_mps)
    if speed_mps <= usual_mps:
        raise InputError(
            f"max_speed_mps is {speed_mps:g}, but the robot drives at speed_mps = {usual_mps:g}",
            "set max_speed_mps above speed_mps, or to 0",
        )
    place = PlaceLimits(max_speed_mps=speed_mps, max_sd_m=number("max_fix_sd_m"), max_gap_s=number("fix_old_s"))
    values: dict[str, Any] = {name: number(name) for name in LIMITS}
    if values["fix_frozen_s"] and parameters.text("navigator") == "goal_pose":
        values["fix_frozen_s"] = max(values["fix_frozen_s"], POSES_FROZEN_S)
    try:
        limits = WatchLimits(place=place, **values)
    except ValueError as error:
        raise InputError(str(error), "correct the parameters") from None
    is_person = parameters.text("navigator") == PERSON
    return person_watch(limits) if is_person else Watch(limits, failsafe_responses(parameters))
