"""The campaign file: which missions to simulate, as grids over what determines a mission."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BeforeValidator
from pydantic import Field as Setting

from soilmoist_ros.configuration import Section, load_model, read_yaml, resource, resource_names
from soilmoist_ros.errors import InputError, Mistake
from soilmoist_ros.mapping.variogram import ModelName
from soilmoist_ros.mapping.variogram_fit import FitMethod
from soilmoist_ros.simulation.mission_run import MissionSettings, Preset

Strategy = Literal["greedy", "monte_carlo", "adaptive_sampling", "random", "lattice"]
KEY_DIGITS = 16


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


def check_dwell(text: str) -> str:
    """A dwell rule as it is, if it is one.

    :raises ValueError: if it is neither ``fmi:SECONDS`` nor ``ami:THRESHOLD``
    """
    kind, _, number = text.partition(":")
    try:
        value = float(number)
    except ValueError:
        value = float("nan")
    highest = {"fmi": float("inf"), "ami": 1.0}.get(kind, 0.0)
    if not 0 < value < highest:
        raise ValueError("give fmi:SECONDS (such as fmi:600) or ami:THRESHOLD (such as ami:0.03)")
    return text


T = TypeVar("T")
Many = Annotated[tuple[T, ...], BeforeValidator(_many), Setting(min_length=1)]
Name = Annotated[str, Setting(min_length=1)]
Dwell = Annotated[str, AfterValidator(check_dwell)]
Positive = Annotated[float, Setting(gt=0)]
NotNegative = Annotated[float, Setting(ge=0)]


class Choices(Section):
    """Values of a mission's settings; each key takes one value or a list."""

    field: Many[Name] | None = None
    """Built-in surrogate fields, or field files (paths start at the campaign file)."""
    strategy: Many[Strategy] | None = None
    """Exploration strategies."""
    dwell: Many[Dwell] | None = None
    """Dwell rules: fmi:SECONDS or ami:THRESHOLD."""
    hours: Many[Positive] | None = None
    """Mission times [h]."""
    variogram: Many[ModelName] | None = None
    """Variogram models."""
    fit: Many[FitMethod] | None = None
    """Ways of fitting the variogram."""
    preset: Many[Preset] | None = None
    """Constants of the exploration."""
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


class Experiment(Choices):
    """One experiment: the grid over all values that it lists."""

    name: Annotated[str, Setting(pattern=r"^[\w-]+$")]
    """Short name."""
    title: str = ""
    """Heading in the report."""
    description: str = ""
    """What it is about, in the report."""


class Published(Section):
    """Which fields stand for which case of the published experiments."""

    high_gradient: Many[Name] | None = None
    """Fields with a high contrast."""
    low_gradient: Many[Name] | None = None
    """Fields with a low contrast."""


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
    published: Published = Published()
    """Fields for the comparison with the published findings."""


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
    campaign = load_model(path, Campaign)
    mistakes = [*_missing_files(campaign, path), *_repeated_names(campaign, path)]
    if mistakes:
        raise InputError(mistakes)
    choices = [_with_whole_paths(experiment, path.parent) for experiment in campaign.experiments]
    defaults = _with_whole_paths(campaign.defaults, path.parent)
    published = {
        key: None if names is None else tuple(_whole_path(name, path.parent) for name in names)
        for key, names in campaign.published
    }
    update = {
        "experiments": tuple(choices),
        "defaults": defaults,
        "published": campaign.published.model_copy(update=published),
    }
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
    paths = {"field": _field_file(settings.field), "graph": Path(settings.graph) if settings.graph else None}
    for name, path in paths.items():
        if path is not None:
            if str(path) not in digests:
                digests[str(path)] = _file_digest(path)
            values[name] = digests[str(path)]
    text = json.dumps(values, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:KEY_DIGITS]


def settings_as_text(settings: MissionSettings) -> str:
    """The settings that differ from the defaults of a mission, for messages; the main ones always."""
    usual = MissionSettings()
    always = ("field", "strategy", "dwell", "seed")
    shown = [
        f"{item.name}={value}"
        for item in fields(settings)
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
    }
    return choices.model_copy(update=update)


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


def _missing_files(campaign: Campaign, path: Path) -> Iterator[Mistake]:
    from soilmoist_ros.simulation.surrogate_field import surrogate_field_names

    known = [*surrogate_field_names(), *resource_names("fields")]
    places: Mapping[str, Choices] = {
        "defaults": campaign.defaults,
        **{f"experiments.{number}": item for number, item in enumerate(campaign.experiments)},
    }
    for where, choices in places.items():
        for field in choices.field or ():
            there = Path(_whole_path(field, path.parent)).is_file() if _is_path(field) else field in known
            if not there:
                yield Mistake(
                    f"there is no field {'file ' if _is_path(field) else ''}{field!r}",
                    f"give one of: {', '.join(known)}; or a path that starts at the campaign file",
                    path,
                    column=f"{where}.field",
                )
        for graph in choices.graph or ():
            if not (path.parent / graph).is_file():
                yield Mistake(
                    f"there is no topological map {graph!r}",
                    "give a path that starts at the campaign file; `soilmoist graph` makes one",
                    path,
                    column=f"{where}.graph",
                )


def _repeated_names(campaign: Campaign, path: Path) -> Iterator[Mistake]:
    names = [experiment.name for experiment in campaign.experiments]
    for number, name in enumerate(names):
        if name in names[:number]:
            yield Mistake(
                f"a second experiment of the name {name!r}", "give it another name", path,
                column=f"experiments.{number}.name",
            )  # fmt: skip
