# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Map soil moisture with a cosmic-ray neutron sensor on a robot: sense, map, explore, record.

The folders follow the data: ``sensing`` turns logger bytes into corrected, geo-tagged counts, ``mapping`` turns
counts into a map of rate and soil moisture with its uncertainty, ``exploration`` chooses where to measure next and
for how long, ``simulation`` makes data of known truth, ``recording`` keeps bags, ``pipeline`` makes runs of logs and
bags, ``reporting`` writes their outputs.

>>> from soilmoist_ros import MissionSettings, simulate_mission
>>> mission = simulate_mission(MissionSettings(field="patches", strategy="lattice", dwell="fmi:120", hours=0.5))
>>> mission
<MissionResult: patches; 10 visits in 0.50 h; the mission time is used up>
"""

import os

# Read when numpy is imported; a program that imports numpy first sets them itself. Matrices are small: with more
# BLAS threads a map takes longer, and its last digits differ from one run to the next, so that it could not be
# computed again bit for bit.
for _variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    from soilmoist_ros.foundation import __version__ as __version__
    from soilmoist_ros.mapping import PoissonKriging as PoissonKriging
    from soilmoist_ros.mapping import Variogram as Variogram
    from soilmoist_ros.mapping import fit_variogram as fit_variogram
    from soilmoist_ros.pipeline import MapSettings as MapSettings
    from soilmoist_ros.pipeline import ReplaySettings as ReplaySettings
    from soilmoist_ros.pipeline import map_logs as map_logs
    from soilmoist_ros.pipeline import replay_bag as replay_bag
    from soilmoist_ros.reporting import open_run as open_run
    from soilmoist_ros.sensing import read_log as read_log
    from soilmoist_ros.simulation import MissionSettings as MissionSettings
    from soilmoist_ros.simulation import simulate_mission as simulate_mission

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "foundation": "__version__",
        "mapping": "PoissonKriging Variogram fit_variogram",
        "pipeline": "MapSettings ReplaySettings map_logs replay_bag",
        "reporting": "open_run",
        "sensing": "read_log",
        "simulation": "MissionSettings simulate_mission",
    },
)
