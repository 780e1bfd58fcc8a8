# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist guide``: show a person with the sensor the next stop, without ROS."""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import Any

import click

from soilmoist_ros.cli import options
from soilmoist_ros.cli.answer import answering, echo, say, wrote
from soilmoist_ros.cli.mission_options import mission_options, with_graph
from soilmoist_ros.cli.replay import map_recording
from soilmoist_ros.foundation import InputError, install, is_installed
from soilmoist_ros.sensing import FORMAT_NAME

GUIDE = (
    *("strategy", "dwell", "hours", "target", "threshold", "speed_mps", "stop_overhead_s", "min_dwell_s"),
    *("until", "until_sd", "until_gain", "certify", "seed", "preset", "model", "fit", "cell_m", "travel", "graph"),
)
"""Mission settings that are options of the command."""
DEFAULTS = {"speed_mps": 1.2, "stop_overhead_s": 5.0}
"""Settings of a person that differ from those of a robot."""


@click.command("guide")
@click.option("--field", type=options.named("field"), default="",
              help="Field file. Default: the border is drawn or walked on the page.")  # fmt: skip
@click.option("--logger-uri", required=True, metavar="URI",
              help="Neutron logger: tcp://HOST:PORT, udp://0.0.0.0:PORT or serial:///dev/ttyUSB0.")  # fmt: skip
@click.option(
    "--gnss-uri",
    required=True,
    metavar="URI",
    help="GNSS receiver that sends NMEA, like --logger-uri; phone: for the one of the phone with the page.",
)
@click.option("--logger", type=options.named("logger"), default=FORMAT_NAME, show_default=True,
              help="Logger format: a shipped name or a YAML file.")  # fmt: skip
@click.option("--site", type=options.named("site"), default="",
              help="Site file: corrections, soil, calibration. Default: a rate map.")  # fmt: skip
@options.sensor_option
@mission_options(GUIDE, DEFAULTS)
@options.earlier_option()
@options.covariate_option()
@click.option("--host", default="127.0.0.1", show_default=True,
              help="Address of the page; 0.0.0.0 for a phone in the network of the cart.")  # fmt: skip
@click.option("--port", type=click.IntRange(0, 65535), default=None,
              help="TCP port of the page. Default: 8050, or a free one.")  # fmt: skip
@click.option("--certificate", type=options.INPUT, help="Certificate of the page (PEM), for https.")
@click.option("--key", type=options.INPUT, help="Key of the certificate, if the file does not have it.")
@click.option("--autostart", is_flag=True, help="Start with the first position, instead of on the page.")
@click.option("--exit", "leave", is_flag=True, help="End with the mission, also on a terminal.")
@click.option("--out", type=options.FILE, required=True,
              help="Folder of the survey; made if missing, continued if it has one.")  # fmt: skip
@answering
def command(
    field: str,
    logger_uri: str,
    gnss_uri: str,
    logger: str,
    site: str,
    sensor: str | float | None,
    choices: dict[str, Any],
    earlier: tuple[Path, ...],
    covariates: tuple[str, ...],
    host: str,
    port: int | None,
    certificate: Path | None,
    key: Path | None,
    autostart: bool,
    leave: bool,
    out: Path,
) -> None:
    """Guide a person with a hand cart, quad or car through an adaptive survey, without ROS.

    The page shows where to go next, and how long to stay. You may go elsewhere: all counts are mapped, and the
    next stop is chosen from there. Ctrl-C ends the command; the same command continues the survey in --out, also
    after a crash. Writes the outputs of replay, and the recording (bag/).
    """
    for extra, module in (("console", "aiohttp"), ("bags", "mcap"), ("bags", "rosbags")):
        if not is_installed(module):
            raise InputError(f"{module} is not installed, and a guided survey needs it", install(extra))
    from soilmoist_ros.console import BORDER, PORT, FieldBorder, GuidedSurvey, GuidePage, GuideSettings, free_port
    from soilmoist_ros.pipeline import write_sensor_site
    from soilmoist_ros.sensing import PHONE, DriverSettings
    from soilmoist_ros.simulation import MissionSettings

    drawn, has_field = out / BORDER, bool(field)
    field = field or str(drawn)
    port = free_port(PORT if port is None else port, host, strict=port is not None)
    if not (out / "records").is_dir() and (has_field or not drawn.is_file()):
        options.prepare_output(out, False)
        if (out / "bag").exists():
            raise InputError("has the recording of another run", "choose another folder", out)
    if sensor is not None:
        write_sensor_site(site, sensor, out / "site.yaml")
        site = str(out / "site.yaml")
    mission = MissionSettings(field=field, **with_graph(choices))
    mission.check()
    devices = DriverSettings(logger_uri, logger, gnss_uri)
    shown = None if certificate is None else (certificate, key)
    with GuidePage(out, host, port, gnss_uri == PHONE, shown) as page:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: page.stop())
        say(f"page       {page.address}")
        if page.invitation:
            echo(page.invitation, err=True)
        if not (has_field or drawn.is_file()) and FieldBorder(page, out, devices).run() is None:
            echo("the field has no border yet: the same command continues", err=True)
            sys.exit(130)
        settings = GuideSettings(
            mission=mission, devices=devices, site=site, earlier=earlier, covariates=covariates,
            autostart=autostart, out=out,
        )  # fmt: skip
        survey = GuidedSurvey(settings, page)
        survey.run()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if not survey.has_records:
            echo("no record has a place yet: the same command continues the survey", err=True)
            sys.exit(130 if survey.ended is None else 1)
        wrote((*map_recording(out / "bag", None, out), out / "bag"), out)
        if survey.ended is None:
            echo("interrupted: the same command continues the survey", err=True)
            sys.exit(130)
        survey.show_report(out / "report.html")
        while not leave and sys.stdin.isatty() and sys.stdout.isatty():
            say(f"page       {page.address} stays until Ctrl-C")
            signal.pause()
