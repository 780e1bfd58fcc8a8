# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the planner, and the mission settings made from them."""

from __future__ import annotations

from typing import Final

from soilmoist_ros.exploration import (
    KNOWN_ACTIONS,
    MAX_UNTIL_SD,
    PUBLISHED_MIN_LAST_DWELL_S,
    ROBOT_RADIUS_M,
    AccessRules,
    Changes,
    ExplorerSettings,
    MissionRules,
    OnSilence,
    Outside,
    RobotMotion,
    Stop,
    Team,
    make_strategy,
    parse_dwell,
)
from soilmoist_ros.foundation import InputError, resource
from soilmoist_ros.mapping import (
    NOTHING,
    CovariateSource,
    Field,
    FieldMapSettings,
    Knowledge,
    load_field,
    read_covariates,
)
from soilmoist_ros.nodes.parameters.declaration import Parameters
from soilmoist_ros.nodes.parameters.guard import WATCH_PARAMETERS
from soilmoist_ros.nodes.parameters.lever_arms import ANTENNA
from soilmoist_ros.nodes.parameters.parameter import COVARIATES, EARLIER, Parameter, Value, of_setting
from soilmoist_ros.pipeline import Target, read_earlier_runs
from soilmoist_ros.sensing import MoistureCurve, load_site


def _row(
    name: str,
    default: Value,
    text: str,
    unit: str = "",
    low: float | None = None,
    choices: tuple[str, ...] = (),
    live: bool = False,
) -> Parameter:
    return Parameter(name=name, default=default, description=text, unit=unit, low=low, choices=choices, live=live)


PARAMETERS: Final = (
    _row("field", "", "field file, or name of a shipped one", live=True),
    of_setting("strategy", description="how the next stop is chosen", live=True),
    of_setting("preset", description="constants of the strategies"),
    of_setting("seed", default=0, description="seed of the strategies' randomness"),
    of_setting("dwell", description="time at a stop: fmi:SECONDS, ami:THRESHOLD or optimal", live=True),
    of_setting("target", live=True),
    _row("site", "", "site file with the calibration, or name of a shipped one; for target vwc"),
    _row("longest_dwell_s", 3600.0, "longest time at a stop", "s", 1.0),
    of_setting("hours", description="time of the mission, the way home and pauses included", low=0.01, live=True),
    of_setting("until_sd", high=MAX_UNTIL_SD, live=True),
    of_setting("until_gain", live=True),
    _row(
        "others",
        [],
        "namespaces of other robots whose planners explore the same field: where one is going or counting, this "
        "one does not go; the own namespace is ignored",
    ),
    _row(
        "keep_apart_m",
        0.0,
        "distance between the centres of this robot and of each of others: for stops, ways past standing robots, "
        "and while it drives; 0 for 2 m, or 1 m more than twice robot_radius_m if that is more",
        "m",
        0.0,
    ),
    _row(
        "other_silent_s",
        30.0,
        "a robot of others whose mission was not heard for this time is lost: its place stays taken until it is "
        "heard or somebody calls planner/release_lost",
        "s",
        3.0,
    ),
    _row(
        "properties",
        [],
        "namespaces in which further properties of the field are mapped, as NAMESPACE or NAMESPACE:WEIGHT; the "
        "robot's own property has the weight 1; a property without a map is left out",
    ),
    EARLIER,
    COVARIATES,
    _row("home", "", "stop to return to at the end; the robot stays where it is if empty", live=True),
    _row(
        "graph",
        "topic",
        "where the robot may drive: topic (the navigation's map), free (straight lines), or a map file",
    ),
    _row("map_topic", "/topological_map_2", "topic of the navigation's map"),
    _row(
        "robot_radius_m",
        ROBOT_RADIUS_M,
        "distance that the robot's centre keeps from no-go areas and, with graph: free, from the border; the "
        "default is half the width of Thorvald, 0 keeps none",
        "m",
        0.0,
    ),
    _row(
        "beyond_m",
        0.1,
        "nodes and edges of the map this far outside the field belong to it; the default allows for errors of the "
        "survey",
        "m",
        0.0,
    ),
    _row(
        "outside",
        "home",
        "use of the map's nodes and edges outside the field, which are never measured at and never cross a no-go "
        "area: never, only the shortest way between the field and home or robot (home), or as any other (way)",
        choices=tuple(Outside),
    ),
    _row(
        "keepout_topic",
        "",
        "topic on which the fence is published as a keep-out mask for Nav2, with costmap_filter_info, if any",
    ),
    _row(
        "keepout_resolution_m",
        0.2,
        "side of a cell of the mask; with half of robot_radius_m or less, no cell of a no-go area is free",
        "m",
        0.01,
    ),
    _row(
        "navigator",
        "goto_node",
        "how goals are sent: to the nodes of a topological map (goto_node), to Nav2 (navigate_to_pose), or as "
        "poses without any answer (goal_pose: a stop is then only a pose where the robot is)",
        choices=("goto_node", "navigate_to_pose", "goal_pose"),
    ),
    _row(
        "action_name",
        "",
        "name of the navigation's action; empty for topological_navigation (goto_node) or navigate_to_pose",
    ),
    _row(
        "action_type",
        "",
        "type of the navigation's action; empty for topological_navigation_msgs/action/GotoNode (goto_node) or "
        "nav2_msgs/action/NavigateToPose",
    ),
    _row(
        "pose_observers",
        ["recorder*", "rosbag2*", "_ros2cli*", "rviz*", "rqt*", "foxglove*", "rosbridge*", "plotjuggler*"],
        "nodes that subscribe to goal_pose but drive no robot, as patterns; all others pass for a navigation",
    ),
    _row(
        "edge_actions",
        list(KNOWN_ACTIONS),
        "actions of edges that the navigation of goto_node knows: edges with others are named in a warning; empty "
        "for no check",
    ),
    _row("feedback_topic", "topological_navigation/feedback", "plain topic of the navigation's feedback"),
    _row("frame", "map", "frame of plan, markers, visits and records: east, north, up about the field's datum"),
    _row("navigation_frame", "", "frame of the navigation's map and goals; empty if it is the same as frame"),
    _row(
        "navigation_datum",
        "field",
        "origin of the navigation's frame: field (the field's datum), LAT,LON[,YAW] in degrees (YAW: its x axis, "
        "counter-clockwise from east), map (named in the navigation's map), or robot (its datum service, else TF "
        "and fixes of a drive)",
    ),
    _row(
        "datum_service",
        "toLL",
        "service of the robot that converts places of its map, for navigation_datum: robot",
    ),
    _row("base_frame", "base_link", "frame of the robot's base in TF"),
    _row(
        "frame_limit_m",
        2.0,
        "largest distance between the robot's place by TF and by its fix; the robot must not drive beyond it",
        "m",
        0.1,
    ),
    *ANTENNA,
    of_setting("speed_mps", description="speed of the robot, to estimate times", low=0.01),
    of_setting("stop_overhead_s"),
    of_setting("turn_s_per_rad"),
    of_setting(
        "learn_travel",
        description="learn speed, turning time and time lost at stops from the legs driven; "
        "the parameters are what is known before",
    ),
    of_setting("stop_cost_s"),
    of_setting("metre_cost_s"),
    _row(
        "arrival_radius_m",
        3.0,
        "the robot is at a stop within this distance, and within half of that to the nearest other node",
        "m",
        0.01,
    ),
    _row(
        "settle_s",
        5.0,
        "standstill that counts as arrival when the navigation gives no result (goal_pose)",
        "s",
        0.1,
    ),
    _row("navigation_wait_s", 30.0, "longest wait for the navigation to appear, or to end a goal", "s", 1.0),
    _row("goal_time_factor", 3.0, "time limit of a trip, in multiples of the expected time", "", 1.0),
    _row("goal_time_margin_s", 60.0, "time added to the limit of a trip", "s", 0.0),
    _row(
        "cancel_limit_s",
        10.0,
        "time after which the robot is asked again to stop if it is not known to stand",
        "s",
        1.0,
    ),
    _row("standstill_s", 4.0, "a stop is confirmed when the robot has not moved for this time", "s", 0.0),
    _row(
        "backoff_s",
        2.0,
        "wait after the first failure; it doubles with each failure in a row, up to 60 s",
        "s",
        0.0,
    ),
    _row("return_margin_s", 60.0, "reserve kept for the way home", "s", 0.0),
    _row(
        "min_dwell_s",
        10.0,
        "shortest time at a stop, whatever the dwell rule says, by default one record; stops that leave less are "
        "skipped",
        "s",
        0.0,
    ),
    _row("map_wait_s", 20.0, "longest wait for the mapper before the next stop is chosen", "s", 0.0),
    _row("plan_limit_s", 120.0, "longest time for choosing a stop", "s", 1.0),
    _row("retries", 1, "how often a goal that failed is sent again", low=0),
    _row("blacklist_s", 900.0, "how long a stop is ruled out after it failed or was skipped", "s", 1.0),
    _row("failures_to_pause", 5, "failures in a row after which the operator is asked", low=1),
    _row("silence_limit_s", 60.0, "time without a record of the stop that counts as silence", "s", 1.0),
    _row("on_silence", "wait", "what to do in silence", choices=tuple(OnSilence)),
    _row("autostart", False, "start the mission as soon as position, map and navigation are there"),
    _row("journal_dir", "", "folder of the mission's journal, to survive a crash; no journal if empty"),
    _row(
        "resume",
        "ask",
        "what to do with an interrupted mission: wait for resume or abort, resume it, or forget it",
        choices=("ask", "auto", "fresh"),
    ),
    *WATCH_PARAMETERS,
    _row(
        "respawn_limit_s",
        0.0,
        "a planner that crashed less than this ago resumes by itself, unless the mission was paused or "
        "crashes again and again; 0 to do as resume says",
        "s",
        0.0,
    ),
    _row("exit_when_finished", False, "end the process with the mission, for simulations"),
)

RECORD_S: Final = 10.0
"""Usual duration of a record [s]; one that is counted wholly at a stop may begin this long after the arrival."""


def explorer_settings(parameters: Parameters, field: Field) -> ExplorerSettings:
    """Settings for the choice of stops.

    :param field: the field
    :raises InputError: if an earlier run or a covariate cannot be used, the dwell rule is invalid, the
        strategy's solver is not installed, or the target is the moisture and there is no calibration
    """
    text, number = parameters.text, parameters.number
    make_strategy(text("strategy"), text("preset"))
    calibration = load_site(text("site")).curve if text("site") else None
    return ExplorerSettings(
        strategy=text("strategy"),
        preset=text("preset"),
        seed=parameters.whole("seed"),
        dwell=parse_dwell(text("dwell"), number("longest_dwell_s")),
        motion=RobotMotion(
            number("speed_mps"),
            number("stop_overhead_s"),
            number("turn_s_per_rad"),
            number("stop_cost_s"),
            number("metre_cost_s"),
        ),
        curve=_required(calibration) if text("target") == "vwc" else None,
        calibration=calibration,
        learn_travel=parameters.flag("learn_travel"),
        knowledge=_knowledge(parameters, field, calibration),
        access=AccessRules(
            robot_radius_m=number("robot_radius_m"),
            beyond_m=number("beyond_m"),
            outside=Outside(text("outside")),
            entry_m=max(number("max_entry_m"), number("max_outside_m")),
            by_name=text("navigator") == "goto_node",
        ),
    )


def chosen_survey(parameters: Parameters, changes: Changes | None) -> tuple[Field, ExplorerSettings]:
    """The field and the settings, with the field, earlier runs and covariates that an operator has chosen.

    :raises InputError: as :func:`explorer_settings`, or if the field file cannot be used
    """
    chosen = changes.of_survey if changes is not None else {}
    values = parameters.changed({name: one if isinstance(one, str) else list(one) for name, one in chosen.items()})
    field = load_field(resource("fields", values.text("field")))
    return field, explorer_settings(values, field)


def _knowledge(parameters: Parameters, field: Field, calibration: MoistureCurve | None) -> Knowledge:
    """What is known of the robot's own property: the earlier surveys and covariates that the mapper has, too."""
    paths = parameters.texts("earlier")
    sources = (*field.covariates, *map(CovariateSource.parse, parameters.texts("covariates")))
    if not (paths or sources):
        return NOTHING
    target = Target(field.frame, field.grid(), FieldMapSettings(curve=calibration))
    runs = read_earlier_runs(paths, target) if paths else ()
    return Knowledge(tuple(run.survey for run in runs), read_covariates(sources, field.frame, target.grid))


def make_team(parameters: Parameters) -> Team:
    """The other robots on the field.

    Two robots touch when their centres are two radii apart. The places of both are known to some 0.3 m with
    corrections, so 1 m is three standard deviations of their distance, rounded up. 2 m is for robots whose radius
    is not given.
    """
    number = parameters.number
    apart_m = number("keep_apart_m") or max(2.0, 2 * number("robot_radius_m") + 1.0)
    return Team(apart_m, number("other_silent_s"))


def _required(calibration: MoistureCurve | None) -> MoistureCurve:
    if calibration is None:
        raise InputError("target is vwc, but there is no calibration", "give a calibrated site file as site")
    return calibration


def mission_rules(parameters: Parameters, settings: ExplorerSettings, home: Stop | None = None) -> MissionRules:
    """Rules of the mission.

    :param parameters: values of :data:`PARAMETERS`
    :param settings: settings for the choice of stops
    :param home: stop to return to
    """
    number = parameters.number
    recommended = settings.preset == "recommended"
    return MissionRules(
        budget_s=number("hours") * 3600,
        dwell=settings.dwell,
        home=home,
        warm_up_stops=settings.warm_up_stops,
        min_dwell_s=number("min_dwell_s"),
        min_last_dwell_s=number("min_dwell_s") + RECORD_S if recommended else PUBLISHED_MIN_LAST_DWELL_S,
        stays=recommended,
        speed_mps=settings.motion.speed_mps,
        stop_overhead_s=settings.motion.stop_overhead_s,
        arrival_radius_m=number("arrival_radius_m"),
        goal_time_factor=number("goal_time_factor"),
        goal_time_margin_s=number("goal_time_margin_s"),
        return_margin_s=number("return_margin_s"),
        cancel_limit_s=number("cancel_limit_s"),
        standstill_s=number("standstill_s"),
        backoff_s=number("backoff_s"),
        plan_limit_s=number("plan_limit_s"),
        retries=parameters.whole("retries"),
        blacklist_s=number("blacklist_s"),
        failures_to_pause=parameters.whole("failures_to_pause"),
        silence_limit_s=number("silence_limit_s"),
        on_silence=OnSilence(parameters.text("on_silence")),
        until_sd=number("until_sd"),
        until_gain=number("until_gain"),
    )
