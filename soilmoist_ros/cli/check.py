# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist check`` reports what files mean, and their mistakes; ``soilmoist logger`` drafts a logger format."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from types import SimpleNamespace as Options
from typing import TYPE_CHECKING, Any, TypeVar

import click

from soilmoist_ros.cli.answer import answering, current, put, say, warn, wrote
from soilmoist_ros.cli.options import FILE, INPUT, Parsed, position_options
from soilmoist_ros.foundation import InputError, Mistake

if TYPE_CHECKING:
    from soilmoist_ros.mapping import Field
    from soilmoist_ros.pipeline import FileFinding
    from soilmoist_ros.sensing import Site

Value = TypeVar("Value")


@click.command("check")
@click.option("--logger", type=Parsed("logger"), multiple=True,
              help="Logger format: a shipped name or a YAML file. Repeatable.")  # fmt: skip
@click.option("--site", type=Parsed("site"), multiple=True,
              help="Site file: a shipped name or a YAML file. Repeatable.")  # fmt: skip
@click.option("--field", type=Parsed("field"), multiple=True,
              help="Field file: a shipped name or a YAML file. Repeatable.")  # fmt: skip
@click.option("--graph", "graphs", type=FILE, multiple=True, help="Topological map of --field. Repeatable.")
@click.option("--home", default="", metavar="NODE", help="Home of the robot in --graph.")
@click.option("--robot-radius", "robot_radius_m", type=click.FloatRange(min=0), default=0.75, show_default=True,
              help="robot_radius_m of the planner [m].")  # fmt: skip
@click.option("--log", "logs", type=INPUT, multiple=True,
              help="Log of the probe of --site, or a folder of logs. Repeatable.")  # fmt: skip
@click.option("--nmea", "--track", type=FILE, multiple=True,
              help="Positions of --log: NMEA, GPX, CSV or a bag. Repeatable.")  # fmt: skip
@click.option("--run", type=FILE, help="Folder of a run with a certificate, which is made again.")
@position_options
@answering
def command(**given: Any) -> None:
    """Check configuration files and report every mistake in them.

    Says what each file means: area and place of a field, moisture range of a calibration, dates, tubes and first
    records of a log. Files that are given together are compared.
    """
    options = Options(**given)
    logger, site, field, logs = options.logger, options.site, options.field, options.logs
    of_logs = {
        "nmea": "nmea",
        "logger_topic": "logger-topic",
        "fix_topic": "fix-topic",
        "gnss_shift_s": "gnss-shift",
    }
    for wrong, text in (
        (
            not (logger or site or field or logs or options.run),
            "give one of --logger, --site, --field, --log, --run",
        ),
        (logs and (len(site) > 1 or len(logger) > 1), "give one --site and one --logger at most with --log"),
        (options.graphs and len(field) != 1, "give one --field with --graph"),
        (options.home and not options.graphs, "--home requires --graph"),
        *((given[name] and not logs, f"--{option} requires --log") for name, option in of_logs.items()),
    ):
        if wrong:
            raise click.UsageError(text)
    mistakes: list[Mistake] = []
    for name in logger:
        _checked(name, partial(_logger, name), mistakes)
    sites = [_checked(name, partial(_site, name), mistakes) for name in site]
    fields = [_checked(name, partial(_field, name, options.robot_radius_m), mistakes) for name in field]
    for place in (one for one in fields if one is not None):
        for graph in options.graphs:
            _checked(graph.name, partial(_graph, place, graph, options.robot_radius_m, options.home), mistakes)
    if options.run is not None:
        _checked(str(options.run), partial(_certificate, options.run), mistakes)
    if not mistakes and len(sites) < 2 and (logger or site or field or logs):
        _compare(next(iter(sites), None), list(zip(field, fields, strict=True)), options, mistakes)
    if mistakes:
        raise InputError(mistakes)


def _checked(
    name: str, check: Callable[[], tuple[Value, Iterable[FileFinding]]], mistakes: list[Mistake]
) -> Value | None:
    """Check one file and print what it means; its mistakes are added to ``mistakes``."""
    try:
        value, findings = check()
        lines = list(findings)
    except InputError as error:
        mistakes += error.mistakes
        return None
    say(f"ok: {name}")
    _print(name, lines)
    return value


def _print(name: str, findings: Iterable[FileFinding]) -> None:
    for finding in findings:
        current().values.setdefault("findings", []).append({"of": name, **finding._asdict()})
        say(f"  {finding.name:<11} {finding.text}")


def _logger(name: str) -> tuple[None, Iterable[FileFinding]]:
    from soilmoist_ros.pipeline import logger_findings
    from soilmoist_ros.sensing import load_logger_format

    return None, logger_findings(load_logger_format(name))


def _site(name: str) -> tuple[Site, Iterable[FileFinding]]:
    from soilmoist_ros.pipeline import site_findings
    from soilmoist_ros.sensing import load_site

    site = load_site(name)
    return site, site_findings(site)


def _field(name: str, robot_radius_m: float) -> tuple[Field, Iterable[FileFinding]]:
    from soilmoist_ros.foundation import read_yaml, resource
    from soilmoist_ros.mapping import load_field
    from soilmoist_ros.pipeline import field_findings, truth_findings
    from soilmoist_ros.simulation import load_surrogate

    path = resource("fields", name)
    field = load_field(path)
    if "truth" in read_yaml(path):
        return field, chain(field_findings(field, robot_radius_m), truth_findings(load_surrogate(path)))
    return field, field_findings(field, robot_radius_m)


def _graph(field: Field, path: Path, robot_radius_m: float, home: str) -> tuple[None, Iterable[FileFinding]]:
    from soilmoist_ros.pipeline import graph_findings

    try:
        return None, list(graph_findings(field, path, robot_radius_m, home))
    except InputError as error:
        raise InputError([replace(one, path=one.path or path) for one in error.mistakes]) from None


def _certificate(folder: Path) -> tuple[None, Iterable[FileFinding]]:
    from soilmoist_ros.pipeline import FileFinding
    from soilmoist_ros.reporting import check_certificate, sample_text, statement_text

    made, compared = check_certificate(folder)
    return None, [
        FileFinding("certificate", compared),
        *(FileFinding(name, statement_text(made, name == "moisture")) for name, one in
          (("rate", made.rate), ("moisture", made.vwc)) if one is not None),
        FileFinding("sample", sample_text(made)),
    ]  # fmt: skip


def _compare(
    site: Site | None, fields: Sequence[tuple[str, Field | None]], options: Options, mistakes: list[Mistake]
) -> None:
    """Check logs, and compare files that are given together."""
    import numpy as np

    from soilmoist_ros.foundation import resource
    from soilmoist_ros.mapping import PositionSource
    from soilmoist_ros.pipeline import (
        contradictions,
        log_findings,
        log_positions,
        log_times,
        position_findings,
        position_source,
        read_logs,
        read_track,
        reading_of,
        skipped_text,
    )
    from soilmoist_ros.sensing import Site

    places, source = np.empty((0, 2)), PositionSource("'location' in the site file")
    if logs := options.logs:
        chosen, nmea = site or Site(), options.nmea

        def check() -> tuple[None, list[FileFinding]]:
            nonlocal places, source
            skipped: list[Mistake] = []
            logger = next(iter(options.logger), None)
            found = read_logs(logs, logger, chosen, topic=options.logger_topic, skipped=skipped)
            if skipped:
                warn(f"warning: {skipped_text(skipped)}")
            others = [] if nmea else [one.path for one in found]
            track, faults = read_track(nmea, others, options.fix_topic, log_times(found), options.gnss_shift_s)
            places, source = log_positions(found, track, chosen), position_source(found, nmea, chosen, None)
            notes = position_findings(found, track, faults, chosen)
            findings = log_findings(found, places, site, time.time(), track, reading_of(found))
            return None, [*findings, *notes]

        _checked(", ".join(path.name or str(path) for path in logs), check, mistakes)
    for name, field in fields or [("", None)]:
        at = source if field is None else replace(source, field_file=resource("fields", name))
        for found in contradictions(field, site, places, at):
            if isinstance(found, Mistake):
                mistakes.append(found)
            else:
                _print("together", [found])


@click.command("logger")
@click.argument("file", type=INPUT)
@click.option("--time", multiple=True, metavar="COLUMN", help="Column of the stamp. Twice for date and time.")
@click.option("--neutrons", "counts", multiple=True, metavar="COLUMN", help="Column of the counts. Repeatable.")
@click.option("--out", type=click.Path(path_type=Path), help="File for the draft. Default: print it.")
@click.option("--overwrite", "--force", is_flag=True, help="Replace the file.")
@answering
def logger(file: Path, time: tuple[str, ...], counts: tuple[str, ...], out: Path | None, overwrite: bool) -> None:
    """Draft a logger format (YAML) from the header and first lines of FILE.

    Each guess has its reason, and what you have to answer is marked QUESTION. Then look at the first records as
    they are understood: soilmoist check --log FILE --logger DRAFT.
    """
    from soilmoist_ros.foundation import InputError
    from soilmoist_ros.sensing import draft_format, load_logger_format

    text = draft_format(file, time, counts)
    put(draft=text)
    if out is None:
        say(text.rstrip("\n"))
        return
    if out.exists() and not overwrite:
        raise InputError("exists already", "give another --out, or --overwrite", out)
    out.write_text(text, encoding="utf-8")
    load_logger_format(out)
    questions = text.count("QUESTION:")
    say(f"{questions} question{'s' * (questions != 1)} in it; then: soilmoist check --log {file} --logger {out}")
    wrote([out])
