# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Examples at the end of each ``--help``; a test parses them all."""

from __future__ import annotations

EXAMPLES = {
    "map": (
        "map examples/rover_gypsum_transect_2018-05-01.KSU --site gypsum_transect --out out/gypsum",
        "map survey.log --nmea gnss.nmea --site my_site.yaml --field my_field.yaml --out out/may",
        "map survey.bag --logger-topic /crns/line --fix-topic /gps/fix --site my_site.yaml --out out/ros1",
        "map june.log --earlier out/may --covariate relief.tif:slope --out out/june",
    ),
    "simulate": (
        "simulate --field patches --hours 1 --out out/patches",
        "simulate --strategy lattice --dwell fmi:120 --seed 7 --out out/lattice",
        "simulate --field validation --robots 3 --until-sd 0.02 --out out/three",
    ),
    "demo": (
        "demo --out out/demo",
        "demo --field validation --hours 2 --robots 3 --out out/team",
        "demo --scenario bad_link --no-console --exit --out out/bad-link",
    ),
    "watch": (
        "watch --field my_field.yaml",
        "watch --field my_field.yaml --robot robot_1 --robot robot_2",
        "watch --field my_field.yaml --robot robot_1 --property salt --layouts out/viewers",
    ),
    "campaign": (
        "campaign paper --runs 1 --out out/paper",
        "campaign my_campaign.yaml --workers 4 --out out/mine",
    ),
    "replay": (
        "replay out/demo --out out/again",
        "replay out/demo --model exponential --nugget filter --out out/smooth",
        "replay bag_0.mcap --field my_field.yaml --site my_site.yaml --out out/field",
    ),
    "bag": ("bag info out/demo", "bag verify runs/may/bag runs/june/bag", "bag recover broken.mcap --out whole"),
    "bag info": ("bag info out/demo", "bag info bag_0.mcap --json"),
    "bag verify": ("bag verify out/demo", "bag verify runs/may/bag runs/june/bag"),
    "bag recover": ("bag recover broken.mcap --out whole",),
    "bag play": ("bag play out/demo --time-factor 10", "bag play out/demo --start 600 --topics '/counts|/fix'"),
    "export": ("export out/farm --to qgis --to kmz", "export out/farm --to zones --zones 4 --out farm_terminal"),
    "season": ("season out/may out/june --out out/season", "season out --title 'Home field' --out out/season"),
    "calibrate": (
        "calibrate cores.csv --site my_site.yaml --log survey.log --dry-run",
        "calibrate cores.csv --site my_site.yaml --counts 61200 --exposure 20400 --date 2026-05-02",
    ),
    "graph": (
        "graph patches --spacing 8 --out lattice.yaml",
        "graph my_field.yaml --rows 3 --heading 20 --out rows.yaml",
    ),
    "list": ("list", "list fields", "list loggers --json"),
    "logger": (
        "logger DATA001.csv --out my_logger.yaml",
        "logger table.csv --time Datum --time Zeit --neutrons N1",
    ),
    "check": (
        "check --site my_site.yaml --field my_field.yaml",
        "check --log survey.KSU --logger hydroinnova_rover --site gypsum_transect",
    ),
}
"""Example commands of each subcommand, without ``soilmoist``."""


def epilog(command: str) -> str:
    """The examples of a subcommand as a text that click leaves as it is."""
    return "\n".join(["\b", "Examples:", *(f"  soilmoist {example}" for example in EXAMPLES[command])])
