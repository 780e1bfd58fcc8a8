# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Map soil moisture with a cosmic-ray neutron sensor on a robot: sense, map, explore, record.

The folders follow the data: ``sensing`` turns logger bytes into corrected, geo-tagged counts, ``mapping`` turns
counts into a map of rate and soil moisture with its uncertainty, ``exploration`` chooses where to measure next and
for how long, ``simulation`` makes data of known truth, ``recording`` keeps runs, ``replay`` maps logs and recorded
runs, ``reporting`` writes the results.

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

from soilmoist_ros.foundation.lazy import load_on_use
from soilmoist_ros.foundation.version import __version__

if TYPE_CHECKING:
    from soilmoist_ros.mapping.kriging.poisson_kriging import PoissonKriging
    from soilmoist_ros.mapping.variogram.fit import fit_variogram
    from soilmoist_ros.mapping.variogram.model import Variogram
    from soilmoist_ros.replay.bag_map import replay_bag
    from soilmoist_ros.replay.log_map import MapSettings, map_logs
    from soilmoist_ros.replay.replay_settings import ReplaySettings
    from soilmoist_ros.reporting.opened_run import open_run
    from soilmoist_ros.sensing.formats.logger_reader import read_log
    from soilmoist_ros.simulation.mission.settings import MissionSettings
    from soilmoist_ros.simulation.mission.simulator import simulate_mission

__all__ = [
    "MapSettings",
    "MissionSettings",
    "PoissonKriging",
    "ReplaySettings",
    "Variogram",
    "__version__",
    "fit_variogram",
    "map_logs",
    "open_run",
    "read_log",
    "replay_bag",
    "simulate_mission",
]

__getattr__ = load_on_use(__name__, __file__)
