# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps a recorded run again: bit for bit with the robot's settings, or with other settings."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from soilmoist_ros import sensing
from soilmoist_ros.foundation import IllConditionedError, InputError, LocalFrame, Mistake, SoilmoistError, duration
from soilmoist_ros.mapping import MappingSettings
from soilmoist_ros.pipeline.bag_lines import CLOUD, TEXT, RunTopics, text_lines
from soilmoist_ros.pipeline.field_survey import FieldSurvey, input_file, loss_rows_of, open_survey, require_crs
from soilmoist_ros.pipeline.mission import (
    RobotMission,
    last_mission,
    mission_visits,
    read_statuses,
    read_visits,
    replay_mission,
)
from soilmoist_ros.pipeline.properties import (
    PropertyTopic,
    ReplayedProperty,
    read_planner,
    read_published_map,
    recorded_frame,
    team_properties,
    trusted_records,
    why_nothing,
)
from soilmoist_ros.pipeline.run import FailedRun, MapRun, NoMapError, Note, NoteCode, Trouble
from soilmoist_ros.recording import (
    BagReader,
    bag_of,
    bags_of,
    configuration_of,
    message_files,
    read_parameters,
    recorder_notes,
)
from soilmoist_ros.simulation import MissionResult, surrogate_field

Progress = Callable[[str, float], None]
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
MAX_TROUBLES = 12
_ERROR = 2
_REPLAY = (
    "Map the recording again when the cause is found: soilmoist replay, with --field or --site if they were wrong."
)


@dataclass(frozen=True, kw_only=True)
class ReplaySettings(MappingSettings):
    """Choices of a replay; settings of :class:`MappingSettings` that are ``None`` are taken from the mapper.

    :param field: field file, or the name of a shipped one; ``None`` for that of the mapper
    :param site: site file, or the name of a shipped one; the records keep the corrections of the driver
    :param crs: coordinate reference system of the outputs, checked before the work; ``None`` for the UTM zone
    :param truths: surrogate fields to compare with (built-in names, or field files with a truth) by name of the
        property; empty for the first one
    :param earlier: earlier runs of the field, see :func:`read_earlier_runs`; ``None`` for those of the robot
    :param covariates: files with covariates as FILE or FILE:BAND, in addition to those of the field; ``None`` for
        those of the robot
    """

    field: Path | str | None = None
    site: Path | str | None = None
    crs: str | None = None
    truths: Mapping[str, str] = dataclasses.field(default_factory=dict)
    counts_topic: str = "counts"
    earlier: Sequence[Path | str] | None = None
    covariates: Sequence[str] | None = None


def robot_survey(bag: Path, configuration: Path | None, chosen: ReplaySettings) -> tuple[FieldSurvey, list[Note]]:
    """The map of the robot's own records, still without records, and remarks for the user."""
    had = read_parameters(configuration, "mapper")
    survey = _open(bag, had, chosen, recorded_frame(configuration), chosen.site)
    if not chosen.site or not had.get("site"):
        return survey, []
    recorded = sensing.load_site(had["site"]).corrections
    if recorded == survey.site.corrections:
        return survey, []
    corrected = survey.site.model_copy(update={"corrections": recorded})
    message = (
        "The counts are corrected as on the robot, not as this site file says: where the bag has the lines of the "
        "logger, soilmoist map corrects them anew."
    )
    return replace(survey, site=corrected), [Note(NoteCode.OTHER_CORRECTIONS, message)]


def _open(
    bag: Path,
    had: Mapping[str, Any],
    chosen: ReplaySettings,
    frame: LocalFrame | None,
    site: Path | str | None = None,
    name: str = "",
) -> FieldSurvey:
    """A map of a property without records: the mapper's settings, overridden by the user's choices."""
    field_file = chosen.field or had.get("field")
    if not field_file:
        raise InputError("does not say which field it is of", "give the field file with --field", bag)
    try:
        return open_survey(
            str(field_file), had.get("site", "") if site is None else str(site),
            simulated=had.get("simulated", False),
            earlier=had.get("earlier", ()) if chosen.earlier is None else chosen.earlier, property_name=name,
            covariates=had.get("covariates", ()) if chosen.covariates is None else chosen.covariates,
            recorded=had or None, frame=frame,
            **{one.name: getattr(chosen, one.name) for one in dataclasses.fields(MappingSettings)},
        )  # fmt: skip
    except ValueError as error:
        raise InputError(str(error), "change this setting") from None


@dataclass(frozen=True, eq=False)
class Replay:
    """A run with all properties, and the comparison of each map with the last one that its mapper published."""

    run: MapRun
    comparisons: Sequence[str]


class _Recording:
    """A run in a bag, read step by step; remarks for the user are added to ``remarks``."""

    def __init__(
        self,
        reader: BagReader,
        survey: FieldSurvey,
        chosen: ReplaySettings,
        configuration: Path | None,
        remarks: list[Note],
    ) -> None:
        self._reader, self._chosen, self._configuration, self._remarks = reader, chosen, configuration, remarks
        self._mapper = read_parameters(configuration, "mapper")
        self._frame = str(self._mapper.get("frame", ""))  # the mapper skips counts of others
        self.survey = survey
        topic = chosen.counts_topic
        team = [] if "/" in topic else RunTopics.of_team(reader, topic, self._mapper.get("others", ()))
        self.robots = team or [RunTopics.of_counts(reader, reader.find_topic(topic, CLOUD))]
        topics = [*(robot.counts for robot in self.robots), *self._of_others()]
        self.several = len(topics) > 1
        self.counted = trusted_records(reader, topics, self._frame)
        """Records as the drivers sent them, each with its topic, in the order in which the mapper added them."""

    def _of_others(self) -> list[str]:
        """Topics of counts of other robots that the mapper of the only robot has mapped."""
        space, _, last = self.robots[0].counts.rpartition("/")
        topics = self._reader.topics
        if len(self.robots) > 1 or not space or topics.get(f"{space}/soil_map") != CLOUD:
            return []
        names = [f"/{name.strip('/')}" for name in self._mapper.get("others", ())]
        return [f"{name}/{last}" for name in names if name != space and topics.get(f"{name}/{last}") == CLOUD]

    def properties(self) -> list[ReplayedProperty]:
        """All properties with their maps, the robot's own first; ``InputError`` if one cannot be read."""
        reader, chosen = self._reader, self._chosen
        found = team_properties(self.robots, self._configuration)
        known = [one.name for one in found]
        truths = {name or known[0]: field for name, field in chosen.truths.items()}
        for name in truths.keys() - set(known):
            raise InputError(f"has no property {name!r}", f"there are: {', '.join(known)}", reader.path)
        properties: list[ReplayedProperty] = []
        for one in found:
            own = one.counts == tuple(robot.counts for robot in self.robots)
            try:
                counted = self.counted if own else trusted_records(reader, one.counts, self._frame)
            except InputError as error:
                if own or one.weight:
                    raise
                note = f"{', '.join(one.counts)} is not mapped: {error}."
                self._remarks.append(Note(NoteCode.NOT_MAPPED, note))
                continue
            records = [record for _, record in counted]
            if not records and not own:
                continue
            survey = self.survey
            if not own:
                # without its mapper's settings as the robot's own, but a calibration belongs to one sensor
                had = read_parameters(self._configuration, one.mapper) or {**self._mapper, "site": ""}
                survey = _open(reader.path, had, chosen, self.survey.field.frame, name=one.name)
            states = [survey.map.state for record in records if survey.map.add(record) is None]
            published = read_published_map(_mapper_topics(one, self.robots, own))
            truth = surrogate_field(truths[one.name]) if one.name in truths else None
            properties.append(ReplayedProperty(one.name, one.weight, survey, records, states, published, truth))
        return properties

    def missions(self) -> list[RobotMission]:
        """The last started mission of each robot that has one."""
        found = []
        for number, robot in enumerate(self.robots, 1):
            its = [record for name, record in self.counted if name == robot.counts and not record.quarantine]
            if statuses := last_mission(read_statuses(robot)):
                visits = mission_visits(statuses, read_visits(robot, number), its)
                planner = read_planner(self._configuration, robot)
                found.append(RobotMission(number, planner, statuses, visits, its))
        return found

    @property
    def simulated(self) -> bool:
        """True if the lines of a logger declare simulated counts."""
        loggers = filter(None, (robot.find("raw/logger", TEXT) for robot in self.robots))
        lines = (line for name in loggers for line in text_lines(self._reader, name))
        return any(line.startswith(b"#simulated=yes") for line in lines)


def replay_bag(
    bag: Path, settings: ReplaySettings | None = None, progress: Progress = lambda step, share: None
) -> Replay:
    """Map the records of a bag.

    :param bag: folder of a bag or of a run, or an MCAP or db3 file
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
        recording = _Recording(reader, survey, chosen, configuration, remarks)
        properties, missions = recording.properties(), recording.missions()
        simulated = recording.simulated
    for one_bag in bags_of(bag):
        lost_messages = "; ".join(f"{name}: {value}" for name, value in recorder_notes(one_bag).items())
        if lost_messages:
            remarks.append(Note(NoteCode.LOST_MESSAGES, f"The recorder noted of {one_bag.name}: {lost_messages}."))
    first = properties[0]
    inputs = [input_file(path, "bag") for one_bag in bags_of(bag) for path in message_files(one_bag)]

    def failure(error: SoilmoistError | None = None) -> NoMapError:
        mission = replay_mission([first], missions, configuration, lambda step, share: None) if missions else None
        run = FailedRun("", (), datetime.now(UTC), inputs=inputs, mission=mission, simulated=simulated)
        return _no_map(bag, first, error, run)

    if not first.states:
        raise failure()
    progress("mapping", 0.0)
    mapped: list[tuple[ReplayedProperty, MapRun]] = []
    for one in properties:
        try:
            run = one.survey.run(one.survey.map.snapshot())
        except (InputError, IllConditionedError) as error:
            if one is first:
                raise failure(error) from error
            remarks.append(Note(NoteCode.NOT_MAPPED, f"{one.name} is not mapped: {error}."))
            continue
        label = one.name if one.truth is None else one.truth.title
        mapped.append((one, replace(run, name=one.name, label=label, truth_rate=one.truth_rate)))
    properties = [one for one, _ in mapped]
    run, *others = (run for _, run in mapped)
    mission = None
    if missions:
        mission = replay_mission(properties, missions, configuration, progress)
        maps = [
            replace(one, soil_map=its.soil_map) for one, (_, its) in zip(mission.properties, mapped, strict=True)
        ]
        mission = replace(mission, properties=maps)
    run = replace(
        run,
        inputs=[*inputs, *run.inputs],
        notes=[*run.notes, *remarks],
        simulated=run.simulated or simulated or any(one.truth is not None for one in properties),
        others=others,
        mission=mission,
    )
    return Replay(run, [one.compared(recording.several) for one in properties])


def _mapper_topics(one: PropertyTopic, robots: Sequence[RunTopics], own: bool) -> RunTopics:
    """Topics of the mapper of a property: that of the robot, or the shared one of several."""
    robot = robots[0]
    if own and len(robots) == 1:
        return robot
    shared = f"/{robot.namespace[:-1]}" if len(robots) > 1 else ""
    return RunTopics(robot.reader, one.counts[0].removeprefix(shared), alone=False)


def _no_map(bag: Path, first: ReplayedProperty, error: SoilmoistError | None, run: FailedRun) -> NoMapError:
    """The error for a run without a map, with all that its report shows."""
    survey = first.survey
    troubles = read_troubles(bag)
    mistake = _mistake(first, troubles, bag, error)
    return NoMapError(
        replace(
            run, why=" ".join(filter(None, [_sentence(mistake.message), _end(run.mission)])),
            todo=[*filter(None, [_sentence(mistake.remedy)]), _REPLAY],
            track=sorted(first.records, key=lambda record: record.stamp_s), site=survey.site.name,
            field_name=survey.field.name,
            inputs=[*run.inputs, *(input_file(path, role) for role, path in survey.files)],
            losses=loss_rows_of(survey.map.snapshot()), troubles=troubles,
            simulated=run.simulated or survey.simulated,
        )
    )  # fmt: skip


def _mistake(
    first: ReplayedProperty, troubles: Sequence[Trouble], bag: Path, error: SoilmoistError | None
) -> Mistake:
    """The cause, the first that applies: no records, none in the field, too few, or a failure of the map."""
    if not first.records:
        said = next((f"; {trouble.name}: {trouble.message}" for trouble in troubles if trouble.error), "")
        return Mistake(
            f"The sensor sent no record that could be used, the counts have no messages{said}",
            "check that the driver ran, the link to the neutron logger and its format: soilmoist check --logger",
        )
    if all(record.quarantine for record in first.records):
        kinds = Counter(sensing.reason_text(record.quarantine) for record in first.records)
        causes = ", ".join(f"{text} ({count})" for text, count in kinds.most_common())
        return Mistake(
            f"All {len(first.records)} records are quarantined: {causes}",
            "check the tubes of the detector, its high voltage and its weather sensors",
        )
    if not first.states:
        return why_nothing(first.survey, first.records, bag).mistakes[0]
    records, samples = len(first.states), len(first.survey.map.samples)
    count = f"{records} record{'s' * (records != 1)} at {samples} place{'s' * (samples != 1)}"
    if isinstance(error, InputError):
        return Mistake(f"{count}: {error.mistakes[0].message}", "give the mission more time, or shorter stops")
    return Mistake(f"{count}: {error}", "try another variogram model or fit")


def _end(mission: MissionResult | None) -> str:
    """End of the mission, in a sentence; empty without a mission."""
    if mission is None or not mission.series:
        return ""
    end = mission.series[-1]
    stops = f"{end.samples or 'no'} finished stop{'s' * (end.samples != 1)}"
    return f"The mission ended after {duration(end.time_s)} with {stops}: {mission.ended}."


def read_troubles(bag: Path) -> list[Trouble]:
    """Warnings and errors that the nodes of a recording reported, errors first, then the most frequent."""
    found: Counter[tuple[str, str, bool]] = Counter()
    with BagReader(bag) as reader:
        topics = [name for name, kind in reader.topics.items() if kind == DIAGNOSTICS]
        for message in reader.messages(topics) if topics else ():
            for status in reader.decode(message).status:
                level = status.level if isinstance(status.level, int) else ord(status.level)
                if level and status.message:
                    found[status.name, status.message, level >= _ERROR] += 1
    order = sorted(found.items(), key=lambda item: (not item[0][2], -item[1]))
    return [Trouble(name, message, count, error) for (name, message, error), count in order[:MAX_TROUBLES]]


def _sentence(text: str) -> str:
    """A message with a capital letter and a full stop."""
    return f"{text[0].upper()}{text[1:].rstrip('.')}." if text else ""
