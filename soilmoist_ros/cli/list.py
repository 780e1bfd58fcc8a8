# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist list``: all that can be chosen by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import click

from soilmoist_ros.cli.answer import answering, put, say

Item = tuple[str, str, Path | None]
"""Something that can be chosen: its name, what it is, and its file (``None`` if built in)."""


def _shipped(kind: str) -> Iterator[tuple[str, Path]]:
    from soilmoist_ros.foundation import resource, resource_names

    for name in resource_names(kind):
        yield name, resource(kind, name)


def _fields() -> Iterator[Item]:
    import numpy as np

    from soilmoist_ros.simulation import known_field, surrogate_field, surrogate_field_names

    files = dict(_shipped("fields"))
    surrogates = surrogate_field_names()
    for name in [*surrogates, *(name for name in files if name not in surrogates)]:
        field = known_field(name)
        width_m, height_m = np.ptp(field.polygon, axis=0).tolist()
        use = f"{surrogate_field(name).hours:g} h" if name in surrogates else "not simulated"
        yield name, f"{field.name}; {width_m:.0f} x {height_m:.0f} m, {use}", files.get(name)


def _strategies() -> Iterator[Item]:
    from soilmoist_ros.exploration import STRATEGIES

    return ((name, STRATEGIES.get(name).about, None) for name in STRATEGIES.names())


def _dwell_rules() -> Iterator[Item]:
    from soilmoist_ros.exploration import DWELL_RULES

    for name in DWELL_RULES.names():
        kind = DWELL_RULES.get(name)
        write = kind.example or (f"{name}:VALUE" if kind.needs_value else name)
        yield name, f"{kind.about} Write {write}.", None


def _models() -> Iterator[Item]:
    from soilmoist_ros.mapping import VARIOGRAM_MODELS

    for name in VARIOGRAM_MODELS.names():
        model = VARIOGRAM_MODELS.get(name)
        reaches = f"reaches {'the' if model.has_edge else '95 % of the'} sill at {model.practical:.2f} ranges"
        yield name, f"{model.label or name}; {reaches}", None


def _loggers() -> Iterator[Item]:
    from soilmoist_ros.sensing import load_logger_format, logger_names, logger_path

    for name in logger_names():
        logger = load_logger_format(name)
        has = [each for each in ("position", "pressure", "temperature", "humidity") if getattr(logger, each)]
        yield name, f"{logger.title}; {', '.join(has) or 'counts alone'}", logger_path(name)


def _sites() -> Iterator[Item]:
    from soilmoist_ros.sensing import load_site

    for name, path in _shipped("sites"):
        site = load_site(path)
        known = site.calibration
        origin = "none" if known is None else "illustrative" if known.illustrative else known.date or "yes"
        yield name, f"{site.name}; calibration: {origin}", path


def _exports() -> Iterator[Item]:
    from soilmoist_ros.reporting import EXPORTS

    for name in EXPORTS.names():
        kind = EXPORTS.get(name)
        yield name, f"{kind.label}: {kind.description}", None


def _campaigns() -> Iterator[Item]:
    from soilmoist_ros.lab import load_campaign

    return ((name, load_campaign(name).title, path) for name, path in _shipped("campaigns"))


def _scenarios() -> Iterator[Item]:
    from soilmoist_ros.simulation import load_scenario

    return ((name, load_scenario(name).title, path) for name, path in _shipped("scenarios"))


KINDS: dict[str, tuple[Callable[[], Iterator[Item]], str]] = {
    "fields": (_fields, "--field of simulate and demo; those that are not simulated: --field of map"),
    "strategies": (_strategies, "--strategy of simulate and demo"),
    "dwell-rules": (_dwell_rules, "--dwell of simulate and demo"),
    "models": (_models, "--model of map, replay, simulate, demo and season"),
    "loggers": (_loggers, "--logger of map, check, calibrate and guide"),
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

    Names, what they stand for and files, those of plug-ins included. Without a KIND, all names.
    Kinds: fields, strategies, dwell-rules, models, loggers, sites, exports, campaigns, scenarios.
    """
    if kind is None:
        for one, (read, _) in KINDS.items():
            items = list(read())
            say(f"{one:12} {', '.join(name for name, _, _ in items)}")
            put(**{one: [dict(zip(("name", "about", "file"), item, strict=True)) for item in items]})
        say("")
        say("soilmoist list KIND says more about each.")
        return
    read, used_by = KINDS[kind]
    items = list(read())
    put(kind=kind, items=[dict(zip(("name", "about", "file"), item, strict=True)) for item in items])
    width = max(len(name) for name, _, _ in items)
    for name, about, _ in items:
        say(f"{name:{width}}  {about}")
    say("")
    say(f"A name is given to: {used_by}.")
    for folder in sorted({str(file.parent) for _, _, file in items if file is not None}):
        say(f"Files, to read and copy: {folder}/NAME.yaml")
