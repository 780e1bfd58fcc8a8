# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulates how good a map becomes in an hour, by the size of the field and by how fast the soil changes.

usage: .venv/bin/python scripts/hours_needed.py [--seeds 4] [--save]

Root mean squared error of the moisture [% by volume] at the end of missions of the
recommended strategy on random square fields, means over the seeds. The moisture is 22 ± 4 % by volume;
the sensor counts 4 neutrons a second, the robot drives 0.6 m/s and loses 12 s at a stop.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import results

from soilmoist_ros.simulation import MissionSettings, simulate_mission

HECTARES, RANGES_M, HOURS = (0.25, 1.0, 4.0), (20, 60), (1.0, 2.0, 4.0)
"""Areas, distances at which moistures are hardly alike any more (95 % of the variance), and mission times."""
FIELD = """
name: Square of {hectares} ha
datum: {{latitude_deg: 53.2680, longitude_deg: -0.5245}}
polygon: [[0, 0], [{side}, 0], [{side}, {side}], [0, {side}]]
truth:
  formula: {{family: matern32, quantity: vwc, mean: 0.22, sd: 0.04, range_m: {range_m}}}
  hours: 1
  soil: {{bulk_density_gcm3: 1.4}}
  calibration: {{n0_cps: 6.0}}
"""
PRACTICAL = 2.74
"""Practical range of a Matérn 3/2 variogram, in units of its range parameter."""


def error(field: Path, hours: float, cell_m: float, seed: int) -> float:
    """Root mean squared error at the end of one mission [% by volume]."""
    settings = MissionSettings(
        field=str(field), random_field=True, hours=hours, seed=seed, cell_m=cell_m, target="vwc"
    )
    return 100 * simulate_mission(settings).series[-1].vwc_rmse


def main() -> None:
    """Simulate all missions."""
    options = results.parser(__doc__)
    options.add_argument("--seeds", type=int, default=4)
    given = options.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "field.yaml"
        for hectares in HECTARES:
            side = round(100 * hectares**0.5)
            for range_m in RANGES_M:
                path.write_text(
                    FIELD.format(hectares=hectares, side=side, range_m=range_m / PRACTICAL), encoding="utf-8"
                )
                row = [f"{hectares:g}", f"{range_m}"]
                for hours in HOURS:
                    found = [error(path, hours, side / 40, seed) for seed in range(1, given.seeds + 1)]
                    row.append(f"±{np.mean(found):.1f} %")
                rows.append(row)
    columns = ("field [ha]", "alike within [m]", *(f"{hours:g} h" for hours in HOURS))
    settings = (
        f"recommended strategy, 22 ± 4 % by volume, 4 counts/s, 0.6 m/s, 12 s at a stop, {given.seeds} seeds"
    )
    results.publish("hours", columns, rows, settings, given.save)


if __name__ == "__main__":
    main()
