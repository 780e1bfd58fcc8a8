# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps a recorded run again: bit for bit with the robot's settings, or with other settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

from soilmoist_ros.foundation import IllConditionedError, InputError
from soilmoist_ros.pipeline.bag_lines import logger_topic
from soilmoist_ros.pipeline.comparison import Comparison, read_published_map
from soilmoist_ros.pipeline.file_facts import position_notes
from soilmoist_ros.pipeline.log_map import loss_rows, read_reference, reference_error, with_reference
from soilmoist_ros.pipeline.mission import RobotMission, replay_mission
from soilmoist_ros.pipeline.no_map import no_map
from soilmoist_ros.pipeline.properties import (
    PropertyTopic,
    ReplayedProperty,
    chosen_properties,
    named_truths,
    read_planner,
    team_properties,
)
from soilmoist_ros.pipeline.raw import RawSurvey, read_raw, says_simulated
from soilmoist_ros.pipeline.recorded_place import recorded_places
from soilmoist_ros.pipeline.replay_settings import ReplaySettings, property_survey, robot_survey
from soilmoist_ros.pipeline.statuses import last_mission, read_statuses
from soilmoist_ros.pipeline.topics import CLOUD, TEXT, RunTopics
from soilmoist_ros.pipeline.visits import mission_visits, read_visits
from soilmoist_ros.recording import (
    MISSED,
    RECEIVED,
    TEAM,
    TEAM_S,
    BagReader,
    MapRecords,
    bag_of,
    bags_of,
    configuration_of,
    message_files,
    read_parameters,
    record_key,
    recorder_notes,
)
from soilmoist_ros.reporting import FieldSurvey, LossRow, MapRun, Note, NoteCode, input_file, require_crs
from soilmoist_ros.sensing import CountRecord, LeverArms, Reference, placed_of_any
from soilmoist_ros.simulation import surrogate_field

Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False, repr=False)
class Replay:
    """The result of a replay.

    :param run: the run with all properties
    :param comparisons: comparison of each property's map with the last map that its mapper published
    """

    run: MapRun
    comparisons: Sequence[Comparison]

    def __repr__(self) -> str:
        names = ", ".join(run.name for run in self.run.properties)
        return f"Replay({names}: {len(self.run.track)} records, {self.comparisons[0].message})"


@dataclass(frozen=True, eq=False)
class _Content:
    """The data that the replay reads from the bag.

    The survey is that of the robot's own records.
    """

    survey: FieldSurvey
    raw: RawSurvey | None
    several: bool
    missions: Sequence[RobotMission]
    simulated: bool
    properties: Sequence[ReplayedProperty]
    reference: Reference | None = None


def replay_bag(
    bag: Path, settings: ReplaySettings | None = None, progress: Progress = lambda step, share: None
) -> Replay:
    """Map the records of a bag.

    :param bag: folder of a bag or of a run, or an MCAP or db3 file
    :param settings: choices
    :param progress: called as the work goes on
    :raises InputError: if the bag or a file cannot be used
    :raises NoMapError: if no map can be made; it has all that a report can show
    """
    chosen = settings or ReplaySettings()
    bag = bag_of(bag)
    progress("reading the bag", 0.0)
    with BagReader(bag) as reader:
        configuration = next(filter(None, map(configuration_of, [bag, *bags_of(bag)])), None)
        survey, remarks = robot_survey(bag, configuration, chosen)
        require_crs(chosen.crs, survey.field.frame)
        content = _read(reader, survey, chosen, configuration, remarks)
    for one_bag in bags_of(bag):
        lost_messages = "; ".join(f"{name}: {value}" for name, value in recorder_notes(one_bag).items())
        if lost_messages:
            remarks.append(Note(NoteCode.LOST_MESSAGES, f"The recorder noted of {one_bag.name}: {lost_messages}."))
    survey = content.survey
    first, raw, reference = content.properties[0], content.raw, content.reference
    lost = loss_rows(raw.problems if raw else ())
    about = (bag, _files(bag), first, content.missions, configuration)
    if not first.states:
        raise no_map(*about, losses=lost, simulated=content.simulated)
    progress("mapping", 0.0)
    mapped = []
    for one in content.properties:
        try:
            run = one.survey.run(one.survey.map.snapshot())
            run = run if reference is None or one.survey is not survey else with_reference(run, reference)
        except (InputError, IllConditionedError) as error:
            if one is first:
                raise no_map(*about, losses=lost, simulated=content.simulated, error=error) from error
            remarks.append(Note(NoteCode.NOT_MAPPED, f"{one.name} is not mapped: {error}."))
            continue
        label = one.name if one.truth is None else one.truth.title
        mapped.append((one, replace(run, name=one.name, label=label, truth_rate=one.truth_rate)))
    properties = [one for one, _ in mapped]
    run, *others = (run for _, run in mapped)
    run = replace(
        run,
        inputs=[*(input_file(path, "bag") for path in _files(bag)), *run.inputs],
        notes=[*run.notes, *remarks],
        losses=_losses(lost, run.losses),
        logger_format=raw.format_title if raw else "",
        simulated=run.simulated or content.simulated or any(one.truth is not None for one in properties),
        others=others,
    )
    if content.missions:
        mission = replay_mission(properties, content.missions, configuration, progress)
        maps = [
            replace(one, soil_map=its.soil_map)
            for one, its in zip(mission.properties, run.properties, strict=True)
        ]
        run = replace(run, mission=replace(mission, properties=maps))
    return Replay(
        run,
        [_compared(one, content, one.survey is survey) for one in properties],
    )


def _losses(of_lines: Sequence[LossRow], of_map: Sequence[LossRow]) -> list[LossRow]:
    """What was left out: of the raw lines, and by the map, which has the quarantined records of the lines, too."""
    known = {row.kind for row in of_lines if row.consequence == "quarantined"}
    return [*of_lines, *(row for row in of_map if not (row.consequence == "quarantined" and row.kind in known))]


def _compared(one: ReplayedProperty, content: _Content, own: bool) -> Comparison:
    if own and content.reference is not None:
        return Comparison(None, "not compared: corrected by a reference sensor")
    if own and content.raw is not None:
        return Comparison(None, "not compared: made again from the raw lines")
    return one.compared(content.several)


def _read(
    reader: BagReader,
    survey: FieldSurvey,
    chosen: ReplaySettings,
    configuration: Path | None,
    remarks: list[Note],
) -> _Content:
    """Read all data that the replay needs.

    :param survey: the map of the robot's own records, without records
    :param remarks: called with each remark for the user
    """
    raw = None
    frame = str(read_parameters(configuration, "mapper").get("frame", ""))  # the mapper skips counts of others
    places = recorded_places(configuration, survey.field)
    robots: list[RunTopics] = []
    others, missed = list[str](), list[str]()
    if chosen.from_lines:
        robots = [
            RunTopics.of_counts(reader, f"{logger_topic(reader, chosen.logger_topic).rpartition('/')[0]}/counts")
            if chosen.logger_topic
            else RunTopics.of_raw_lines(reader, chosen.counts_topic)
        ]
        arms = LeverArms.of(read_parameters(configuration, "sensor_driver"))
        raw = read_raw(
            robots[0], survey.site, survey.field.frame, chosen.logger, arms, chosen.logger_topic, chosen.fix_topic,
            chosen.gnss_shift_s,
        )  # fmt: skip
        counted = [(robots[0].counts, record) for record in raw.records]
        remarks += [Note(NoteCode.POSITIONS, f"{one}.") for one in position_notes(raw.position_problems, None)]
    else:
        if "/" not in chosen.counts_topic:
            together = read_parameters(configuration, "mapper").get("others", ())
            robots = RunTopics.of_team(reader, chosen.counts_topic, together)
        robots = robots or [RunTopics.of_counts(reader, reader.find_topic(chosen.counts_topic, CLOUD))]
        others, missed = _of_others(robots, configuration)
        counted = reader.read_counts_of([*missed, *(robot.counts for robot in robots), *others], frame)
        placed = places.records([record for _, record in counted])
        counted = [(name, record) for (name, _), record in zip(counted, placed, strict=True)]
        if missed:
            counted = _in_order(counted, missed, survey)
    doubts = {name: places.doubts(reader, name) for name in {name for name, _ in counted}}
    counted = [
        (name, placed_of_any(record, doubts.values()) if name in missed else doubts[name].placed(record))
        for name, record in counted
    ]
    records = [record for _, record in counted]
    reference = None
    if chosen.reference is not None and (good := [record for record in records if not record.quarantine]):
        reference = read_reference(chosen.reference, survey.site, good, survey.field.frame)
        records = reference.corrected(records)
        survey = survey.with_reference_error(reference_error(reference))
        counted = [(name, record) for (name, _), record in zip(counted, records, strict=True)]
    found = team_properties(robots, configuration)
    wanted = chosen_properties(found, chosen.properties, reader.path)
    truths = named_truths(found, chosen.truths, reader.path)
    properties: list[ReplayedProperty] = []
    for one in wanted:
        own = one.counts == tuple(robot.counts for robot in robots)
        try:
            its = records if own else places.trusted_records(reader, one.counts, frame)
        except InputError as error:
            if one.weight or one.name in chosen.properties:
                raise
            remarks.append(Note(NoteCode.NOT_MAPPED, f"{', '.join(one.counts)} is not mapped: {error}."))
            continue
        if not its and not own:
            continue
        mapped = survey if own else property_survey(one, reader.path, configuration, chosen)
        truth = truths.get(one.name)
        states = [mapped.map.state for record in its if mapped.map.add(record) is None]
        published = read_published_map(_mapper_topics(one, robots, own))
        known = None if truth is None else surrogate_field(truth)
        properties.append(ReplayedProperty(one.name, one.weight, mapped, its, states, published, known))
    if not properties:
        raise InputError("has no records of these properties", "choose others, or none for all", reader.path)
    loggers = [logger for robot in robots if (logger := robot.find("raw/logger", TEXT)) is not None]
    simulated = any(says_simulated(reader, logger) for logger in loggers)
    missions = []
    for number, robot in enumerate(robots, 1):
        its = [record for name, record in counted if name == robot.counts and not record.quarantine]
        if statuses := last_mission(read_statuses(robot)):
            visits = places.visits(mission_visits(statuses, read_visits(robot, number), its))
            missions.append(RobotMission(number, read_planner(configuration, robot), statuses, visits, its))
    return _Content(survey, raw, len(robots) > 1 or bool(others), missions, simulated, properties, reference)


def _of_others(robots: Sequence[RunTopics], configuration: Path | None) -> tuple[list[str], list[str]]:
    """Topics of other robots that the mapper of the only robot has mapped: counts, and counts sent again."""
    space, _, last = robots[0].counts.rpartition("/")
    topics = robots[0].reader.topics
    if len(robots) > 1 or not space or topics.get(f"{space}/soil_map") != CLOUD:
        return [], []
    names = [f"/{name.strip('/')}" for name in read_parameters(configuration, "mapper").get("others", ())]
    found = [
        [f"{name}/{topic}" for name in names if name != space and topics.get(f"{name}/{topic}") == CLOUD]
        for topic in (last, MISSED)
    ]
    return found[0], found[1]


def _in_order(
    counted: Sequence[tuple[str, CountRecord]], missed: Sequence[str], survey: FieldSurvey
) -> list[tuple[str, CountRecord]]:
    """Records in the order in which the mapper added them, each once.

    :param counted: records in the order of recording, each with its topic
    :param missed: topics with records that mappers have sent again
    """
    records, topics = MapRecords(survey.map, TEAM_S), dict[bytes, str]()
    for again, some in groupby(counted, key=lambda each: each[0] in missed):
        part = list(some)
        for name, record in part:
            if not again or record_key(record) not in topics:
                topics[record_key(record)] = name
        found = [record for _, record in part]
        if again:
            records.read_anew(TEAM, found)
        else:
            records.take(RECEIVED, found)
    survey.map.reset()
    return [(topics[record_key(record)], record) for record in records.in_order]


def _mapper_topics(one: PropertyTopic, robots: Sequence[RunTopics], own: bool) -> RunTopics:
    """Topics of the mapper of a property: that of the robot, or the shared one of several."""
    robot = robots[0]
    if len(robots) > 1:
        return RunTopics(robot.reader, one.counts[0].removeprefix(f"/{robot.namespace[:-1]}"), alone=False)
    return robot if own else RunTopics(robot.reader, one.counts[0], alone=False)


def _files(bag: Path) -> list[Path]:
    """The files with the messages of a bag, or of the bags in a folder."""
    return [path for one in (bags_of(bag) if bag.is_dir() else [bag]) for path in message_files(one)]
