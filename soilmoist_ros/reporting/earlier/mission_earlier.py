# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Earlier surveys of a simulated mission: finished runs, and the series that it simulated itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from soilmoist_ros.mapping import FieldMapSettings, SoilMap, default_merge_radius_m
from soilmoist_ros.reporting.earlier.earlier_runs import EarlierRun, Target, read_earlier_runs
from soilmoist_ros.simulation import MappedProperty, MissionSettings, mission_fields, mission_properties

EARLIER = "earlier"
"""Folder in the output of a mission with the runs of its simulated earlier surveys."""


def mission_earlier(settings: MissionSettings, paths: Sequence[Path]) -> Mapping[str, tuple[EarlierRun, ...]]:
    """Finished runs as earlier surveys of each property of a simulated mission, by its name.

    :param settings: the mission
    :param paths: as :func:`read_earlier_runs`
    :raises InputError: as :func:`read_earlier_runs`
    """
    if not paths:
        return {}
    fields = mission_fields(settings)
    grid = fields[0].field.grid(settings.cell_m)
    found = {}
    for number, (one, wanted) in enumerate(zip(fields, mission_properties(settings), strict=True)):
        curve = None if number else one.curve
        choices = FieldMapSettings(fit=settings.fit, curve=curve, footprint_radius_m=settings.footprint_m)
        found[wanted.name] = read_earlier_runs(
            paths, Target(one.frame, grid, choices, wanted.name, number == 0, True)
        )
    return found


def simulated_runs(mapped: MappedProperty, soil_map: SoilMap) -> tuple[EarlierRun, ...]:
    """The series of surveys that a mission simulated, in order of time.

    :param mapped: a property of the mission
    :param soil_map: its map
    """
    radius_m = default_merge_radius_m(soil_map.grid, FieldMapSettings().margin_m)
    runs = [
        EarlierRun(
            one.survey(radius_m, 0.0),
            Path(EARLIER) / f"survey_{back}",
            one.records[0].stamp_s - one.records[0].exposure_s,
            one.records,
        )
        for back, one in enumerate(mapped.series, 1)
    ]
    return tuple(reversed(runs))
