# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters of ``console``."""

from __future__ import annotations

from typing import Final

from soilmoist_ros.nodes.parameters.declaration import Parameter

PARAMETERS: Final = (
    Parameter(name="field", default="", description="field file, or name of a shipped one"),
    Parameter(
        name="host",
        default="127.0.0.1",
        description="address to listen on; 0.0.0.0 for all networks. From other machines the page is read-only, "
        "unless it is opened with the token that the console prints",
    ),
    Parameter(name="port", default=8050, description="TCP port of the page; 0 for a free one", low=0, high=65535),
    Parameter(
        name="names",
        default=[],
        description="host names under which the page is reached; addresses, localhost and the name of this "
        "computer are always allowed",
    ),
    Parameter(
        name="address",
        default="",
        description="address of the page behind a proxy, such as https://robot.example/; then nobody steers "
        "without the token that the console prints; empty without a proxy",
    ),
    Parameter(
        name="robots",
        default=[],
        description="namespaces of the robots on the field; that of this node if empty",
    ),
    Parameter(
        name="runs",
        default="recordings",
        description="folder whose runs the page shows, and where comparisons are written",
    ),
    Parameter(
        name="background",
        default="",
        description="picture below the map: a GeoTIFF, such as an orthophoto, or a folder of tiles z/x/y.png of a "
        "web map; empty for none",
    ),
    Parameter(
        name="field_dir", default="fields", description="folder of field files; drawn fields are saved there"
    ),
    Parameter(
        name="covariate_dir",
        default="covariates",
        description="folder of GeoTIFFs that may be chosen as covariates",
    ),
    Parameter(
        name="foxglove_port",
        default=0,
        description="TCP port of a live view for the viewer Foxglove, on the address host (needs the extra "
        "foxglove); whoever reaches it sees all topics, and can steer nothing; 0 for none",
        low=0,
        high=65535,
    ),
    Parameter(name="map_topic", default="/topological_map_2", description="topic of the navigation's map"),
)
