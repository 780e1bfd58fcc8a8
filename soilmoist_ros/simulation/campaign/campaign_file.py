"""The campaign file: which missions to simulate, as grids over what determines a mission."""

from __future__ import annotations

import hashlib
import itertools
import json
import logging
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from dataclasses import fields as dataclass_fields
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BeforeValidator, model_validator
from pydantic import Field as Setting

from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.exploration.strategies.registry import STRATEGIES
from soilmoist_ros.foundation.configuration import (
    Section,
    config_folder,
    line_of,
    load_model,
    read_yaml,
    resource,
    resource_names,
)
from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.foundation.suggestions import did_you_mean
from soilmoist_ros.mapping.variogram.correlation import ModelName
from soilmoist_ros.mapping.variogram.fit import FitMethod
from soilmoist_ros.simulation.mission.settings import MissionSettings, Preset, PropertySettings

FindingKey = Literal["ami_high", "ami_low", "adaptive_sampling", "greedy_border"]
"""Short names of the published findings."""
KEY_DIGITS = 16
_log = logging.getLogger(__name__)


def _many(value: Any) -> Any:
    """One value stands for a list of one."""
    return tuple(value) if isinstance(value, (list, tuple)) else (value,)


def _seeds(value: Any) -> Any:
    """A number N of runs stands for the seeds 1..N."""
    if isinstance(value, int) and not isinstance(value, bool):
        if value < 1:
            raise ValueError("there must be at least one run")
        return tuple(range(1, value + 1))
    if isinstance(value, (list, tuple)):
        return tuple(value)
    raise ValueError("give the number of runs or a list of seeds")


def _distinct(values: tuple[int, ...]) -> tuple[int, ...]:
    if len(set(values)) < len(values):
        raise ValueError("each seed may be given only once")
    return values


def plain_dwell(text: str) -> str:
    """A dwell rule in its plainest form, so that ``ami:3%`` and ``ami:0.03`` are the same missions.

    :raises ValueError: if it is no dwell rule
    """
    try:
        return str(parse_dwell(text))
    except InputError as error:
        raise ValueError(str(error)) from None


def known_strategy(name: str) -> str:
    """A strategy as it is, if there is one of the name.

    :raises ValueError: if not
    """
    if name not in STRATEGIES:
        known = ", ".join(STRATEGIES)
        raise ValueError(f"there is no strategy {name!r} -> use one of: {known}{did_you_mean(name, STRATEGIES)}")
    return name


def _lists(value: Any) -> Any:
    """One list of properties, or one property, stands for a list of one list."""
    many = value if isinstance(value, (list, tuple)) else [value]
    listed = bool(many) and all(isinstance(one, (list, tuple)) for one in many)
    return tuple(map(tuple, many)) if listed else (tuple(many),)


def _property(text: Any) -> PropertySettings:
    try:
        return text if isinstance(text, PropertySettings) else PropertySettings.parse(str(text))
    except InputError as error:
        raise ValueError(str(error)) from None


def _with_properties(part: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a part with ``properties`` instead of ``also`` and ``also_weight``."""
    old = ("also", "also_weight")
    given = {name: value for name, value in {**defaults, **part}.items() if name in old}
    renamed = {name: value for name, value in part.items() if name not in old}
    if len(renamed) < len(part):
        _log.warning("the keys 'also' and 'also_weight' have become 'properties'; the next release drops them")
        weights = _many(given.get("also_weight", 1.0))
        grid = [[f"{name}:{weight}"] for name in _many(given.get("also", "")) if name for weight in weights]
        renamed["properties"] = grid or []
    return renamed


T = TypeVar("T")
Many = Annotated[tuple[T, ...], BeforeValidator(_many), Setting(min_length=1)]
Name = Annotated[str, Setting(min_length=1)]
Strategy = Annotated[str, AfterValidator(known_strategy)]
Dwell = Annotated[str, AfterValidator(plain_dwell)]
Properties = tuple[Annotated[PropertySettings, BeforeValidator(_property)], ...]
Positive = Annotated[float, Setting(gt=0)]
NotNegative = Annotated[float, Setting(ge=0)]


class Choices(Section):
    """Values of a mission's settings; each key takes one value or a list."""

    field: Many[Name] | None = None
    """Built-in surrogate fields, or field files (paths start at the campaign file)."""
    strategy: Many[Strategy] | None = None
    """Exploration strategies."""
    dwell: Many[Dwell] | None = None
    """Dwell rules: fmi:SECONDS, ami:THRESHOLD or ami:PERCENT%, or optimal."""
    hours: Many[Positive] | None = None
    """Mission times [h]."""
    variogram: Many[ModelName] | None = None
    """Variogram models."""
    fit: Many[FitMethod] | None = None
    """Ways of fitting the variogram."""
    preset: Many[Preset] | None = None
    """Constants of the exploration."""
    map_from: Many[Literal["stops", "records"]] | None = None
    """What is mapped: the stops only, as published, or all records, those on the way too."""
    target: Many[Literal["rate", "vwc"]] | None = None
    """What is to be known well: the rate, or the moisture."""
    travel: Many[Literal["free", "graph"]] | None = None
    """Straight lines, or the field's travel graph."""
    graph: Many[Name] | None = None
    """Topological maps with the travel graph, files (paths start at the campaign file)."""
    speed_mps: Many[Positive] | None = None
    """Speeds of the robot [m/s]."""
    stop_overhead_s: Many[NotNegative] | None = None
    """Times lost at each stop [s]."""
    turn_s_per_rad: Many[NotNegative] | None = None
    """Times for each radian turned on the way [s/rad]."""
    cadence_s: Many[Positive] | None = None
    """Durations of a record [s]."""
    cell_m: Many[Positive] | None = None
    """Cell sizes of the map [m]; the field's own if left out."""
    footprint_m: Many[NotNegative] | None = None
    """Radii of the sensor's footprint [m]."""
    position_sd_m: Many[NotNegative] | None = None
    """GNSS noise of each coordinate [m]."""
    weather: Many[bool] | None = None
    """Whether the weather changes."""
    series_every_s: Many[Positive] | None = None
    """Time between the entries of a mission's series [s]."""
    robots: Many[Annotated[int, Setting(ge=1)]] | None = None
    """Numbers of robots that share one map."""
    random_field: Many[bool] | None = None
    """Whether what is random in the field is drawn anew for each seed."""
    properties: Annotated[tuple[Properties, ...], BeforeValidator(_lists)] | None = None
    """Further properties of a mission, each FIELD or FIELD:WEIGHT; a list of lists makes a grid."""


class Experiment(Choices):
    """One experiment: the grid over all values that it lists."""

    name: Annotated[str, Setting(pattern=r"^[\w-]+$")]
    """Short name."""
    title: str = ""
    """Heading in the report."""
    description: str = ""
    """What it is about, in the report."""


class Published(Section):
    """How the campaign compares with the published experiments: which fields stand for which case of them."""

    high_gradient: Many[Name] | None = None
    """Fields with a high contrast."""
    low_gradient: Many[Name] | None = None
    """Fields with a low contrast."""
    reasons: Mapping[FindingKey, str] = Setting(default_factory=dict)
    """Why this very campaign differs from a finding, as was established; shown where it does."""


class Campaign(Section):
    """A set of simulated missions that are run and reported together."""

    title: Name
    """Title of the report."""
    description: str = ""
    """First paragraph of the report."""
    runs: Annotated[
        tuple[Annotated[int, Setting(ge=0)], ...],
        BeforeValidator(_seeds),
        AfterValidator(_distinct),
        Setting(min_length=1),
    ]
    """Number of runs per combination, or their seeds."""
    table_every_s: Positive = 300.0
    """Time between the rows of the results table [s]."""
    defaults: Choices = Choices()
    """Values for experiments that do not give their own."""
    experiments: Annotated[tuple[Experiment, ...], Setting(min_length=1)]
    """The experiments."""
    published: Published | None = None
    """Comparison with the published findings; none if left out."""

    @model_validator(mode="before")
    @classmethod
    def _read_old_keys(cls, content: Any) -> Any:
        """Keys of earlier releases, read for one release."""
        if not isinstance(content, Mapping):
            return content
        defaults = _mapping(content.get("defaults"))
        experiments = content.get("experiments")
        renamed = dict(content)
        if defaults:
            renamed["defaults"] = _with_properties(defaults, {})
        if isinstance(experiments, list):
            renamed["experiments"] = [
                _with_properties(part, defaults) if isinstance(part, Mapping) else part for part in experiments
            ]
        return renamed


@dataclass(frozen=True)
class Mission:
    """One mission of a campaign.

    :param key: name of its file: a digest of its settings and of the content of its field file
    :param settings: what determines it
    :param experiments: names of the experiments that it belongs to
    """

    key: str
    settings: MissionSettings
    experiments: tuple[str, ...]


def load_campaign(name: str) -> Campaign:
    """Read a campaign file.

    :param name: path of a file, or name of a shipped campaign
    :raises InputError: with every mistake in the file, a field that does not exist included
    """
    path = resource("campaigns", name)
    mistakes = list(_beyond_keys(read_yaml(path), path))
    try:
        campaign = load_model(path, Campaign)
    except InputError as error:
        raise InputError([*error.mistakes, *mistakes]) from None
    if mistakes:
        raise InputError(mistakes)
    choices = [_with_whole_paths(experiment, path.parent) for experiment in campaign.experiments]
    defaults = _with_whole_paths(campaign.defaults, path.parent)
    published = campaign.published and _published_with_whole_paths(campaign.published, path.parent)
    update = {"experiments": tuple(choices), "defaults": defaults, "published": published}
    return campaign.model_copy(update=update)


def missions(campaign: Campaign) -> list[Mission]:
    """All missions of a campaign, in the order of the file; one that two experiments share occurs once."""
    found: dict[str, Mission] = {}
    digests: dict[str, str] = {}
    for experiment in campaign.experiments:
        for settings in combinations(campaign, experiment):
            key = mission_key(settings, digests)
            known = found.get(key)
            if known is None:
                found[key] = Mission(key, settings, (experiment.name,))
            elif experiment.name not in known.experiments:
                found[key] = replace(known, experiments=(*known.experiments, experiment.name))
    return list(found.values())


def combinations(campaign: Campaign, experiment: Experiment) -> Iterator[MissionSettings]:
    """The settings of an experiment's missions, seed by seed within each combination."""
    grid = {
        name: values
        for name in Choices.model_fields
        if (values := getattr(experiment, name) or getattr(campaign.defaults, name)) is not None
    }
    for combination in itertools.product(*grid.values()):
        for seed in campaign.runs:
            yield MissionSettings(**dict(zip(grid, combination, strict=True)), seed=seed)


def mission_key(settings: MissionSettings, digests: dict[str, str] | None = None) -> str:
    """Digest of what determines a mission; a file counts by its content and that of the files it names.

    :param digests: digests of field files and graphs found so far, to be extended
    """
    values = asdict(settings)
    digests = {} if digests is None else digests
    paths = {
        "field": _field_file(settings.field),
        "graph": Path(settings.graph) if settings.graph else None,
    }

    def digest(path: Path) -> str:
        if str(path) not in digests:
            digests[str(path)] = _file_digest(path)
        return digests[str(path)]

    values |= {name: digest(path) for name, path in paths.items() if path is not None}
    for about in values["properties"]:
        if (path := _field_file(about["field"])) is not None:
            about["field"] = digest(path)
    text = json.dumps(values, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:KEY_DIGITS]


def settings_as_text(settings: MissionSettings) -> str:
    """The settings that differ from the defaults of a mission, for messages; the main ones always."""
    usual = MissionSettings()
    always = ("field", "strategy", "dwell", "seed")
    shown = [
        f"{item.name}={value}"
        for item in dataclass_fields(settings)
        if (value := getattr(settings, item.name)) != getattr(usual, item.name) or item.name in always
    ]
    return " ".join(shown)


def _is_path(field: str) -> bool:
    return bool(re.search(r"[/\\]|\.ya?ml$", field))


def _whole_path(field: str, folder: Path) -> str:
    return str((folder / field).resolve()) if _is_path(field) else field


def _with_whole_paths(choices: Any, folder: Path) -> Any:
    update = {
        "field": choices.field and tuple(_whole_path(name, folder) for name in choices.field),
        "graph": choices.graph and tuple(str((folder / name).resolve()) for name in choices.graph),
        "properties": choices.properties
        and tuple(
            tuple(replace(one, field=_whole_path(one.field, folder)) for one in listed)
            for listed in choices.properties
        ),
    }
    return choices.model_copy(update=update)


def _published_with_whole_paths(published: Published, folder: Path) -> Published:
    cases = {"high_gradient": published.high_gradient, "low_gradient": published.low_gradient}
    update = {case: names and tuple(_whole_path(name, folder) for name in names) for case, names in cases.items()}
    return published.model_copy(update=update)


def _field_file(field: str) -> Path | None:
    """The file behind a field, ``None`` for a built-in one."""
    if _is_path(field):
        return Path(field)
    return resource("fields", field) if field in resource_names("fields") else None


def _file_digest(path: Path) -> str:
    """Digest of a file and of the files that it names.

    :raises InputError: if the file cannot be read
    """
    digest = hashlib.sha256()
    try:
        digest.update(path.read_bytes())
        for name in sorted(set(_texts(read_yaml(path)))):
            with suppress(OSError, ValueError):  # most texts are no names of files, some cannot even be
                digest.update(b"\0" + (path.parent / name).read_bytes())
    except OSError as error:
        raise InputError(f"the file cannot be read: {error.strerror}", "check its path", path) from None
    return f"sha256:{digest.hexdigest()}"


def _texts(node: Any) -> Iterator[str]:
    """All texts among the values of a YAML file."""
    if isinstance(node, str):
        yield node
    elif isinstance(node, Mapping):
        for value in node.values():
            yield from _texts(value)
    elif isinstance(node, (list, tuple)):
        for value in node:
            yield from _texts(value)


def _beyond_keys(content: Any, path: Path) -> Iterator[Mistake]:
    """Mistakes in what the values stand for, found in the bare file, so that wrong keys do not hide them."""
    root = _mapping(content)
    defaults, listed = _mapping(root.get("defaults")), root.get("experiments")
    experiments = [_mapping(item) for item in listed] if isinstance(listed, list) else []
    places: list[tuple[int | str, ...]] = [("defaults",), *(("experiments", n) for n in range(len(experiments)))]

    def mistake(place: tuple[int | str, ...], key: str, message: str, remedy: str) -> Mistake:
        where = (*place, key)
        return Mistake(message, remedy, path, line_of(content, where), ".".join(str(part) for part in where))

    names: list[str] = []
    for place, part in zip(places, [defaults, *experiments], strict=True):
        fields = {
            "field": list(_texts(part.get("field"))),
            "also": list(_texts(part.get("also"))),
            "properties": [_property_field(text) for text in _texts(part.get("properties"))],
        }
        for key, names_of in fields.items():
            for field in names_of:
                try:
                    faults = list(_faults_of_field(field, path.parent))
                except InputError as error:
                    yield from error.mistakes
                else:
                    yield from (mistake(place, key, *fault) for fault in faults)
        for graph in _texts(part.get("graph")):
            if not (path.parent / graph).is_file():
                remedy = "give a path that starts at the campaign file; `soilmoist graph` makes one"
                yield mistake(place, "graph", f"there is no topological map {graph!r}", remedy)
        if part is defaults:
            continue
        given = {**defaults, **part}
        if given.get("graph") is not None and set(_texts(given.get("travel"))) != {"graph"}:
            remedy = "add 'travel: graph', or leave the graph out"
            yield mistake(place, "graph", "a graph is given, but the robot travels freely", remedy)
        name = str(part.get("name"))
        if name in names:
            yield mistake(place, "name", f"a second experiment of the name {name!r}", "give it another name")
        names.append(name)


def _property_field(text: str) -> str:
    """The field of a property; the text itself if it is not one, which is a mistake elsewhere."""
    with suppress(InputError):
        return PropertySettings.parse(text).field
    return text


def _faults_of_field(name: str, folder: Path) -> Iterator[tuple[str, str]]:
    """What is wrong with the name of a field, and what to do.

    :raises InputError: if its file cannot be read
    """
    from soilmoist_ros.simulation.fields.catalogue import surrogate_field_names

    shipped = {file: config_folder() / "fields" / f"{file}.yaml" for file in resource_names("fields")}
    usable = [*surrogate_field_names(), *(file for file, path in shipped.items() if _has_truth(path))]
    remedy = f"give one of: {', '.join(usable)}; or a path that starts at the campaign file"
    path = Path(_whole_path(name, folder)) if _is_path(name) else shipped.get(name)
    if name in usable:
        return
    if path is None or not path.is_file():
        yield f"there is no field {'file ' if _is_path(name) else ''}{name!r}", remedy
    elif not _has_truth(path):
        yield (
            f"the field {name!r} has no truth: it cannot be simulated",
            f"add a section 'truth' to it, or {remedy}",
        )


def _has_truth(path: Path) -> bool:
    return "truth" in _mapping(read_yaml(path))


def _mapping(content: Any) -> Mapping[str, Any]:
    return content if isinstance(content, Mapping) else {}
