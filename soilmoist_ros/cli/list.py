# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist list``: all that can be chosen by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

from soilmoist_ros.cli.answer import answering, put, say, tables

Item = dict[str, Any]
"""Something that can be chosen by its name: name, about, its traits by words, and file (``None`` if built in)."""


def _shipped(kind: str) -> Iterator[tuple[str, Path]]:
    from soilmoist_ros.foundation import resource, resource_names

    for name in resource_names(kind):
        yield name, resource(kind, name)


def _item(name: str, about: str, file: Path | None = None, **traits: Any) -> Item:
    return {"name": name, "about": about, **traits, "file": file}


def _fields() -> Iterator[Item]:
    import numpy as np

    from soilmoist_ros.mapping import load_field
    from soilmoist_ros.simulation import surrogate_field, surrogate_field_names

    files = dict(_shipped("fields"))
    surrogates = surrogate_field_names()
    for name in [*surrogates, *(name for name in files if name not in surrogates)]:
        surrogate = surrogate_field(name) if name in surrogates else None
        place = surrogate.field if surrogate is not None else load_field(files[name])
        width_m, height_m = np.ptp(place.polygon, axis=0).tolist()
        traits: dict[str, Any] = {"size": f"{width_m:.0f} x {height_m:.0f} m", "simulated": surrogate is not None}
        if surrogate is not None:
            traits["hours"] = surrogate.hours
        yield _item(name, place.name, files.get(name), **traits)


def _strategies() -> Iterator[Item]:
    from soilmoist_ros.exploration import STRATEGIES
    from soilmoist_ros.simulation import PRESETS

    for name in STRATEGIES.names():
        kind = STRATEGIES.get(name)
        presets = [preset for preset, values in PRESETS.items() if values["strategy"] == name]
        traits: dict[str, Any] = {"label": kind.label, "needs_map": kind.needs_map, "baseline": kind.is_baseline}
        yield _item(name, kind.about, **traits, presets=presets)


def _dwell_rules() -> Iterator[Item]:
    from soilmoist_ros.exploration import DWELL_RULES

    for name in DWELL_RULES.names():
        kind = DWELL_RULES.get(name)
        yield _item(name, kind.about, write=kind.example or (f"{name}:VALUE" if kind.needs_value else name))


def _models() -> Iterator[Item]:
    from soilmoist_ros.mapping import VARIOGRAM_MODELS

    for name in VARIOGRAM_MODELS.names():
        model = VARIOGRAM_MODELS.get(name)
        about = f"{model.label or name}; reaches {'the' if model.has_edge else '95 % of the'} sill at"
        yield _item(name, about, ranges=round(model.practical, 2))


def _loggers() -> Iterator[Item]:
    from soilmoist_ros.sensing import load_logger_format, logger_names, logger_path

    for name in logger_names():
        logger = load_logger_format(name)
        weather = [each for each in ("pressure", "temperature", "humidity") if getattr(logger, each) is not None]
        traits: dict[str, Any] = {"positions": logger.position is not None, "weather": weather}
        yield _item(name, logger.title, logger_path(name), **traits)


def _sites() -> Iterator[Item]:
    from soilmoist_ros.sensing import load_site

    for name, path in _shipped("sites"):
        site = load_site(path)
        known = site.calibration
        calibration = "none" if known is None else "illustrative" if known.illustrative else known.date or "yes"
        yield _item(name, site.name, path, calibration=calibration, stationary=site.location is not None)


def _exports() -> Iterator[Item]:
    from soilmoist_ros.reporting import EXPORTS

    for name in EXPORTS.names():
        kind = EXPORTS.get(name)
        yield _item(name, f"{kind.label}: {kind.description}", suffix=kind.suffix)


def _campaigns() -> Iterator[Item]:
    from soilmoist_ros.lab import load_campaign, missions

    for name, path in _shipped("campaigns"):
        campaign = load_campaign(name)
        yield _item(name, campaign.title, path, missions=len(missions(campaign)))


def _scenarios() -> Iterator[Item]:
    from soilmoist_ros.simulation import load_scenario

    for name, path in _shipped("scenarios"):
        yield _item(name, load_scenario(name).title, path)


KINDS: dict[str, tuple[Callable[[], Iterator[Item]], str]] = {
    "fields": (_fields, "--field of simulate and demo; those that are not simulated: --field of map"),
    "strategies": (_strategies, "--strategy of simulate and demo"),
    "dwell-rules": (_dwell_rules, "--dwell of simulate and demo"),
    "models": (_models, "--model of map, replay, simulate, demo and season"),
    "loggers": (_loggers, "--logger of map, replay and calibrate"),
    "sites": (_sites, "--site of map and replay"),
    "exports": (_exports, "--to of export"),
    "campaigns": (_campaigns, "campaign NAME"),
    "scenarios": (_scenarios, "--scenario of demo"),
}
"""Kinds of things with names: the function that reads all, and where a name is given."""


@click.command("list")
@click.argument("kind", type=click.Choice(tuple(KINDS)), required=False, metavar="[KIND]")
@answering
def command(kind: str | None) -> None:
    """List what can be chosen by name: fields, strategies, loggers, sites ...

    Names, what they stand for, their traits and files, those of plug-ins included. Without a KIND, all names.
    Kinds: fields, strategies, dwell-rules, models, loggers, sites, exports, campaigns, scenarios.
    """
    if kind is None:
        for one, (read, _) in KINDS.items():
            items = list(read())
            say(f"{one:12} {', '.join(item['name'] for item in items)}")
            put(**{one: items})
        say("")
        say("soilmoist list KIND says more about each.")
        return
    read, used_by = KINDS[kind]
    items = list(read())
    put(kind=kind, items=items)
    _print(items)
    say("")
    say(f"A name is given to: {used_by}.")
    for folder in sorted({str(item["file"].parent) for item in items if item["file"] is not None}):
        say(f"Files, to read and copy: {folder}/NAME.yaml")


def _print(items: list[Item]) -> None:
    from rich.table import Table

    from soilmoist_ros.recording import plain_text, print_plain

    keys = [key for key in dict.fromkeys(key for item in items for key in item) if key != "file"]
    titles = ("name", "what it is", *(key.replace("_", " ") for key in keys[2:]))
    table = Table(*titles, box=None, pad_edge=False)
    table.columns[0].no_wrap = True
    for item in items:
        table.add_row(*(plain_text(_text(item.get(key))) for key in keys))
    print_plain(tables(), table)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(value) or "-"
    return "" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
