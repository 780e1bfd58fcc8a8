# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The campaign file: the missions to simulate, as grids over mission settings."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from pydantic import AfterValidator, BeforeValidator, create_model
from pydantic import Field as Setting

from soilmoist_ros.foundation import Section, load_model, read_limited, read_yaml, resource, resource_names
from soilmoist_ros.lab.comparisons import LATTICE_DWELLS
from soilmoist_ros.simulation import SETTINGS, MissionSettings
from soilmoist_ros.simulation import Setting as MissionSetting

KEY_DIGITS = 16
MAX_RUNS = 1_000_000  # runs with different seeds, given by their number


def _many(value: Any) -> Any:
    """A single value means a list of one."""
    return tuple(value) if isinstance(value, (list, tuple)) else (value,)


def _seeds(value: Any) -> Any:
    """A number N means the seeds 1..N."""
    if isinstance(value, int) and not isinstance(value, bool):
        if not 1 <= value <= MAX_RUNS:
            raise ValueError(f"there must be 1 to {MAX_RUNS} runs")
        return tuple(range(1, value + 1))
    if isinstance(value, (list, tuple)):
        return tuple(value)
    raise ValueError("give the number of runs or a list of seeds")


def _distinct(values: tuple[int, ...]) -> tuple[int, ...]:
    if len(set(values)) < len(values):
        raise ValueError("each seed may be given only once")
    return values


def _lists(value: Any) -> Any:
    """A single list of properties, or a single property, means a list of one list."""
    many = value if isinstance(value, (list, tuple)) else [value]
    listed = bool(many) and all(isinstance(one, (list, tuple)) for one in many)
    return tuple(map(tuple, many)) if listed else (tuple(many),)


T = TypeVar("T")
Many = Annotated[tuple[T, ...], BeforeValidator(_many), Setting(min_length=1)]
Name = Annotated[str, Setting(min_length=1)]
Positive = Annotated[float, Setting(gt=0)]


def _key(setting: MissionSetting) -> Any:
    """Type and default of the campaign key of a setting, for ``create_model``: one value, a list, or none."""
    value = Annotated[Any, AfterValidator(setting.checked)]
    many = BeforeValidator(_lists if setting.kind is tuple else _many)
    listed = Annotated[tuple[value, ...], many, Setting(min_length=1)]
    return (listed | None, Setting(default=None, description=setting.help))


if TYPE_CHECKING:

    class Choices(Section):
        """Values of mission settings; each key takes one value or a list. ``runs`` defines the seeds."""
else:
    Choices = create_model(
        "Choices", __base__=Section,
        **{name: _key(setting) for name, setting in SETTINGS.items() if name != "seed"},
    )  # fmt: skip


class Experiment(Choices):
    """One experiment: the grid over all listed values."""

    name: Annotated[str, Setting(pattern=r"^[\w-]+$")]  # short name
    title: str = ""  # heading in the report
    description: str = ""  # description in the report
    hindsight: bool = False
    """Run lattices with fixed dwells of 10, 20, 30 and 60 s too; the report compares all with the best of them."""


def _named_once(experiments: tuple[Experiment, ...]) -> tuple[Experiment, ...]:
    names = [one.name for one in experiments]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ValueError(f"two experiments are named {twice[0]!r}: give one another name")
    return experiments


class Campaign(Section):
    """A set of simulated missions that are run and reported together."""

    title: Name
    """Title of the report."""
    description: str = ""
    """First paragraph of the report."""
    runs: Annotated[
        tuple[Annotated[int, Setting(ge=0)], ...], BeforeValidator(_seeds), AfterValidator(_distinct),
        Setting(min_length=1),
    ]  # fmt: skip
    """Number of runs per combination, or their seeds."""
    table_every_s: Positive = 300.0
    """Time between the rows of the results table [s]."""
    defaults: Choices = Choices()
    """Default values for experiments."""
    experiments: Annotated[tuple[Experiment, ...], AfterValidator(_named_once), Setting(min_length=1)]


@dataclass(frozen=True)
class CampaignMission:
    """One mission of a campaign."""

    key: str  # name of the file: a digest of the settings and of the content of the field file
    settings: MissionSettings
    experiments: tuple[str, ...]  # names of the experiments with this mission


def load_campaign(name: str) -> Campaign:
    """Read a campaign file.

    :param name: path of a file, or name of a shipped campaign
    :raises InputError: with every mistake in the file
    """
    path = resource("campaigns", name)
    campaign = load_model(path, Campaign)
    choices = [_with_whole_paths(experiment, path.parent) for experiment in campaign.experiments]
    defaults = _with_whole_paths(campaign.defaults, path.parent)
    return campaign.model_copy(update={"experiments": tuple(choices), "defaults": defaults})


def missions(campaign: Campaign) -> list[CampaignMission]:
    """All missions of a campaign, in the order of the file; a mission shared by experiments occurs once."""
    found: dict[str, CampaignMission] = {}
    digests: dict[str, str] = {}
    for experiment in campaign.experiments:
        for settings in combinations(campaign, experiment):
            key = mission_key(settings, digests)
            known = found.get(key)
            if known is None:
                found[key] = CampaignMission(key, settings, (experiment.name,))
            elif experiment.name not in known.experiments:
                found[key] = replace(known, experiments=(*known.experiments, experiment.name))
    return list(found.values())


def combinations(campaign: Campaign, experiment: Experiment) -> Iterator[MissionSettings]:
    """Settings of the missions of an experiment: all seeds of a combination, then the next combination.

    The lattices from which hindsight chooses come last.
    """
    grid = {
        name: values
        for name in Choices.model_fields
        if (values := getattr(experiment, name) or getattr(campaign.defaults, name)) is not None
    }
    grids = [grid]
    if experiment.hindsight:
        grids.append({**grid, "strategy": ("lattice",), "dwell": LATTICE_DWELLS})
    for one in grids:
        for combination in itertools.product(*one.values()):
            for seed in campaign.runs:
                yield MissionSettings(**dict(zip(one, combination, strict=True)), seed=seed)


def mission_key(settings: MissionSettings, digests: dict[str, str] | None = None) -> str:
    """Digest of the settings of a mission and of its files, those that they name too; adds to ``digests``."""
    values = settings.as_dict()
    digests = {} if digests is None else digests
    paths = {"field": _field_file(settings.field_name), "graph": Path(settings.graph) if settings.graph else None}

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


@cache  # a campaign has thousands of missions on a few fields
def _field_file(field: str) -> Path | None:
    """The file of a field, ``None`` for a built-in one."""
    if _is_path(field):
        return Path(field)
    return resource("fields", field) if field in resource_names("fields") else None


def _file_digest(path: Path) -> str:
    """Digest of a file and of the files that it names; raises ``InputError`` if the file cannot be read."""
    digest = hashlib.sha256(read_limited(path))
    for name in sorted(set(_texts(read_yaml(path)))):
        named = path.parent / name
        with suppress(OSError):  # most texts are not file names; some are invalid file names
            if named.is_file():  # not a device or a pipe, which may have no end
                with named.open("rb") as file:
                    digest.update(b"\0")
                    hashlib.file_digest(file, lambda: digest)
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
