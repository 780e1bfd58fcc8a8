# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of ``mapper``."""

from __future__ import annotations

from typing import Final

from soilmoist_ros.nodes.parameters.declaration import COVARIATES, EARLIER, Parameter, of_setting
from soilmoist_ros.nodes.parameters.stamps import STAMP_LIMITS

PARAMETERS: Final = (
    Parameter(name="field", default="", description="field file, or the name of a shipped one", live=True),
    Parameter(
        name="site", default="", description="site file, or the name of a shipped one; empty for a rate map only"
    ),
    Parameter(
        name="cell_m",
        default=0.0,
        description="cell size of the map; 0 for the cell size of the field file",
        unit="m",
        low=0,
    ),
    of_setting("model", description="variogram model"),
    of_setting("fit"),
    of_setting("noise"),
    of_setting("local"),
    of_setting("drift_model"),
    Parameter(
        name="keep_nugget",
        default=True,
        description="whether the map includes the micro-scale variation (the nugget)",
    ),
    Parameter(
        name="merge_radius_m",
        default=0.0,
        description="records within this distance become one sample; 0 for a radius chosen from footprint "
        "and extent of the field",
        unit="m",
        low=0,
        high=1000,
    ),
    *STAMP_LIMITS,
    Parameter(name="frame", default="map", description="frame of all published messages"),
    Parameter(
        name="start_from",
        default="",
        description="save folder, bag, or journal of an interrupted mission whose records the map starts "
        "with; empty for none",
    ),
    Parameter(
        name="start_property",
        default="",
        description="property in start_from whose records the map starts with, as in the planner's "
        "properties; empty for the planner's own field",
    ),
    EARLIER,
    COVARIATES,
    Parameter(
        name="record_dir",
        default="",
        description="folder where driver and mapper store the records of this map, so that a restart continues "
        "it; empty to store none",
    ),
    Parameter(
        name="merge_from",
        default=[],
        description="folders of the planner's journal and of recordings; the map adds records that are only there "
        "(needs record_dir)",
    ),
    Parameter(
        name="others",
        default=[],
        description="namespaces of other robots on the field whose counts are mapped as well; the own "
        "namespace is ignored",
    ),
    Parameter(name="save_dir", default="soilmoist_map", description="folder that the service save writes to"),
    Parameter(
        name="simulated",
        default=False,
        description="whether the counts are simulated; every output is marked then",
    ),
)
