# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A recorded run without a map: why, from its records, its mission and what its nodes reported."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from soilmoist_ros.foundation import InputError, Mistake, SoilmoistError
from soilmoist_ros.pipeline.mission import RobotMission, replay_mission
from soilmoist_ros.pipeline.properties import ReplayedProperty
from soilmoist_ros.pipeline.recorded_place import why_nothing
from soilmoist_ros.recording import BagReader
from soilmoist_ros.reporting import FailedRun, LossRow, NoMapError, Trouble, duration, input_file, loss_rows_of
from soilmoist_ros.sensing import reason_text
from soilmoist_ros.simulation import MissionResult

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
MAX_TROUBLES = 12
_ERROR = 2
_REPLAY = (
    "Map the recording again when the cause is found: soilmoist replay, with --field or --site if they were wrong."
)


def no_map(
    bag: Path,
    files: Sequence[Path],
    first: ReplayedProperty,
    missions: Sequence[RobotMission],
    configuration: Path | None,
    *,
    losses: Sequence[LossRow] = (),
    simulated: bool = False,
    error: SoilmoistError | None = None,
) -> NoMapError:
    """The error for a run without a map, with all that its report shows.

    :param bag: the recording
    :param files: its files
    :param first: the property without a map
    :param missions: missions of the robots
    :param configuration: folder with the parameters of the nodes, if any
    :param losses: records that were lost before they reached the map
    :param simulated: whether the counts come from a simulation
    :param error: why the map could not be computed, if there were samples
    """
    survey = first.survey
    snapshot = survey.map.snapshot()
    mission = replay_mission([first], missions, configuration, lambda step, share: None) if missions else None
    troubles = read_troubles(bag)
    mistake = _mistake(first, troubles, bag, error)
    return NoMapError(
        FailedRun(
            why=" ".join(filter(None, [_sentence(mistake.message), _end(mission)])),
            todo=[*filter(None, [_sentence(mistake.remedy)]), _REPLAY],
            created_utc=datetime.now(UTC),
            track=sorted(first.records, key=lambda record: record.stamp_s),
            site=survey.site.name,
            field_name=survey.field.name,
            inputs=[
                *(input_file(path, "bag") for path in files),
                *(input_file(path, role) for role, path in survey.files),
            ],
            losses=[*losses, *loss_rows_of(snapshot)],
            troubles=troubles,
            mission=mission,
            simulated=simulated or survey.simulated,
        )
    )


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
        kinds = Counter(reason_text(record.quarantine) for record in first.records)
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
    """How the mission ended, in a sentence; empty without a mission."""
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
