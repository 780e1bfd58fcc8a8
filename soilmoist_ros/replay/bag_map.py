"""A recorded run, mapped again at a desk: with the settings that the robot had, bit for bit, or with others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

from soilmoist_ros.foundation.configuration import resource
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.variogram.fit import FitMethod
from soilmoist_ros.mapping.variogram.model import ModelName
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.recording.run_folder import bag_of, configuration_of, read_parameters
from soilmoist_ros.replay.comparison import OnLine, compare, read_on_line
from soilmoist_ros.replay.log_map import loss_rows
from soilmoist_ros.replay.mission import last_mission, read_statuses, replay_mission
from soilmoist_ros.replay.online_survey import OnlineSurvey, open_survey
from soilmoist_ros.replay.raw import RawSurvey, read_raw, says_simulated
from soilmoist_ros.replay.second import Second, not_mapped, read_second
from soilmoist_ros.replay.topics import CLOUD, TEXT, RunTopics
from soilmoist_ros.reporting.map_run import input_file
from soilmoist_ros.reporting.run import MapRun
from soilmoist_ros.sensing.moisture.site import load_site
from soilmoist_ros.sensing.records import CountRecord
from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField

Progress = Callable[[str, float], None]
Source = Literal["counts", "raw"]

_OPTIONS = ("cell_m", "model", "fit", "keep_nugget", "merge_radius_m")


@dataclass(frozen=True)
class ReplaySettings:
    """Choices of a replay; what is ``None`` is as the mapper had it on line.

    :param field: field file, or name of a shipped one
    :param site: site file, or name of a shipped one; other corrections need the source ``raw``
    :param truth: surrogate field to compare with: a built-in name, or a field file with a truth
    :param model: variogram model
    :param fit: how the variogram is fitted
    :param keep_nugget: map the rate with its micro-scale variation, or the smooth part only
    :param merge_radius_m: records closer together than this become one sample [m]
    :param cell_m: cell size of the map [m]
    :param counts_topic: topic with the records
    :param source: what is mapped: ``counts``, the records as the driver corrected and placed them, or ``raw``,
        the lines of logger and receiver (``raw/logger``, ``raw/gnss``), corrected and placed anew
    :param logger: format of the raw lines of the logger; told from their header if ``None``
    :param also_truth: surrogate field to compare the map of a second property with
    """

    field: str | None = None
    site: str | None = None
    truth: str | None = None
    model: str | None = None
    fit: str | None = None
    keep_nugget: bool | None = None
    merge_radius_m: float | None = None
    cell_m: float | None = None
    counts_topic: str = "counts"
    source: Source = "counts"
    logger: str | None = None
    also_truth: str | None = None


@dataclass(frozen=True, eq=False)
class Replay:
    """What a replay comes to.

    :param run: for the outputs; the map of a second property is with its mission
    :param as_on_line: whether the map of the same records equals the last one that the mapper published, bit for
        bit; ``None`` if there is none, or it was not made of the records in the bag
    :param comparison: the same in words, with the reason
    :param also_comparison: the same of the map of a second property, empty without one
    """

    run: MapRun
    as_on_line: bool | None
    comparison: str
    also_comparison: str = ""


@dataclass(frozen=True, eq=False)
class _Content:
    """What the replay takes from the bag."""

    records: Sequence[CountRecord]
    raw: RawSurvey | None
    statuses: Sequence[dict[str, str]]
    on_line: OnLine | None
    simulated: bool
    second: Second | None
    left_out: Sequence[str]


def replay_bag(
    bag: Path, settings: ReplaySettings | None = None, progress: Progress = lambda step, share: None
) -> Replay:
    """Map the records of a bag.

    :param bag: folder of a bag or of a run, or an MCAP or db3 file
    :param settings: choices
    :param progress: called as the work goes on
    :raises InputError: if the bag or a file cannot be used, or no map can be made
    :raises IllConditionedError: as :meth:`FieldMap.compute`
    """
    chosen = settings or ReplaySettings()
    bag = bag_of(bag)
    progress("reading the bag", 0.0)
    with BagReader(bag) as reader:
        configuration = configuration_of(bag)
        survey, warnings = _survey(bag, configuration, chosen)
        truth = None if chosen.truth is None else surrogate_field(chosen.truth)
        content = _read(reader, survey, chosen, configuration)
    states = [survey.online.state for record in content.records if survey.online.add(record) is None]
    if not states:
        raise InputError(_why_nothing(survey, content.records), "check the field file and the GNSS", bag)
    progress("mapping", 0.0)
    run = survey.run(survey.online.snapshot())
    as_on_line, comparison = None, "not compared: made anew from what logger and receiver sent"
    if content.raw is None:
        as_on_line, comparison = compare(survey.online, states, content.on_line)
    run = replace(
        run,
        inputs=[*(input_file(path, "bag") for path in _files(bag)), *run.inputs],
        warnings=[*run.warnings, *warnings, *content.left_out],
        losses=[*loss_rows(content.raw.problems if content.raw else ()), *run.losses],
        logger_format=content.raw.format_title if content.raw else "",
        simulated=run.simulated or content.simulated or truth is not None,
        truth_rate=None if truth is None else _true_raster(truth, survey),
    )
    statuses = last_mission(content.statuses)
    if not statuses:
        return Replay(run, as_on_line, comparison)
    second = content.second
    mission = replay_mission(survey, states, statuses, truth, configuration, content.records, progress, second)
    mission = replace(mission, soil_map=run.soil_map, also=None if second is None else second.mapped())
    also_comparison = "" if second is None else second.compared()
    return Replay(replace(run, mission=mission), as_on_line, comparison, also_comparison)


def _survey(bag: Path, configuration: Path | None, chosen: ReplaySettings) -> tuple[OnlineSurvey, list[str]]:
    """The on-line map without records, and what the user should know of it."""
    had = read_parameters(configuration, "mapper")
    survey = _open(bag, had, chosen, had.get("site", "") if chosen.site is None else chosen.site)
    if chosen.source == "raw" or not chosen.site or not had.get("site"):
        return survey, []
    recorded = load_site(resource("sites", had["site"])).corrections
    if recorded == survey.site.corrections:
        return survey, []
    corrected = survey.site.model_copy(update={"corrections": recorded})
    return replace(survey, site=corrected), [
        "The counts are corrected as they were on the robot, not as this site file says: that needs the raw lines."
    ]


def _open(bag: Path, had: Mapping[str, Any], chosen: ReplaySettings, site: str) -> OnlineSurvey:
    """An on-line map as a mapper had it, but for what is chosen.

    :param had: parameters of the mapper
    """
    field = chosen.field or had.get("field")
    if not field:
        raise InputError("does not say which field it is of", "give the field file with --field", bag)
    options: dict[str, Any] = {name: had[name] for name in (*_OPTIONS, "simulated") if name in had}
    options |= {name: value for name in _OPTIONS if (value := getattr(chosen, name)) is not None}
    for name, known in (("model", get_args(ModelName)), ("fit", get_args(FitMethod))):
        if options.get(name, known[0]) not in known:
            raise InputError(f"there is no {name} {options[name]!r}", f"choose one of: {', '.join(known)}")
    try:
        return open_survey(field, site, **options)
    except ValueError as error:
        raise InputError(str(error), "change this setting") from None


def _read(reader: BagReader, survey: OnlineSurvey, chosen: ReplaySettings, configuration: Path | None) -> _Content:
    raw, simulated = None, False
    if chosen.source == "raw":
        topics = RunTopics.beside_raw(reader, chosen.counts_topic)
        raw = read_raw(topics, survey.site, survey.field.frame, chosen.logger)
        records: Sequence[CountRecord] = raw.records
    else:
        topics = RunTopics.beside(reader, reader.find_topic(chosen.counts_topic, CLOUD))
        records = reader.read_counts(topics.counts)
        if not records:
            raise InputError(f"{topics.counts} has no messages", "was the driver running?", reader.path)
    logger = topics.find("raw/logger", TEXT)
    if logger is not None:
        simulated = says_simulated(reader, logger)
    statuses = read_statuses(topics)
    second = None
    if last_mission(statuses):
        second = read_second(
            topics,
            configuration,
            lambda had: _open(reader.path, had, chosen, had.get("site", "")),
            chosen.also_truth,
        )
    if second is None and chosen.also_truth is not None:
        remedy = "it takes a mission whose planner had properties; leave --also-truth out"
        raise InputError("has no second property to compare with a truth", remedy, reader.path)
    left_out = not_mapped(topics, configuration, second)
    return _Content(records, raw, statuses, read_on_line(topics), simulated, second, left_out)


def _files(bag: Path) -> list[Path]:
    """The files of a bag with its messages, compressed ones included."""
    if not bag.is_dir():
        return [bag]
    return [path for path in sorted(bag.iterdir()) if {".mcap", ".db3"} & set(path.suffixes)]


def _why_nothing(survey: OnlineSurvey, records: Sequence[CountRecord]) -> str:
    reasons = [
        f"{entry.count} {reason.value} (the last: {entry.example})"
        for reason, entry in survey.online.skipped.items()
    ]
    return f"not one of {len(records)} records is in the field {survey.field.name!r}: {'; '.join(reasons)}"


def _true_raster(truth: SurrogateField, survey: OnlineSurvey) -> Any:
    grid = survey.online.grid
    return grid.to_raster(truth.rate_at(grid.cells))
