# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Irrigation by the dose zones of a map, compared with one dose for the whole field, on simulated fields.

The robot surveys a field, and its map has a calibration of 1.5 % that is wrong by a draw of it. The limit where
plants lack water is midway between the driest and the wettest tenth of the field, and field capacity is 5 % by
volume above it. A place that lacks water needs to be filled to field capacity, 300 mm deep; one that does not lack
it needs none. ``too much`` is water above the need of a place, ``missed`` the need that a place does not get, both
as a share of the need of the field. The uniform plan has the true mean need of the field.

usage: .venv/bin/python scripts/dose_comparison.py [--draws N] [--save]
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[_variable] = "1"  # before numpy is imported

import numpy as np
import results

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from soilmoist_ros.reporting.dose import DoseSettings, dose_at, find_dose, zones_mean, zones_of_dose
from soilmoist_ros.reporting.geometry import field_polygon
from soilmoist_ros.sensing import CalibrationCurve
from soilmoist_ros.simulation import MissionSettings, simulate_mission

FIELDS, HOURS, N0_SHARE = ("patches", "strips", "rough", "smooth"), (1.0, 3.0), 0.015
DEPTH_MM, ABOVE, STEPS_MM, WIDTH_M = 300.0, 0.05, 5.0, 6.0


def shares(field: str, hours: float, seed: int) -> tuple[float, float, float, float, float]:
    """Too much and missed of the uniform dose and of the zones, and the mean probability of right zones [0..1]."""
    result = simulate_mission(MissionSettings(field=field, hours=hours, seed=seed))
    soil_map, error = result.soil_map, np.random.default_rng(seed).normal() * N0_SHARE
    assert soil_map is not None
    mask, cells = soil_map.grid.mask, soil_map.grid.cells
    curve = soil_map.curve or CalibrationCurve(6.2, 1.4)
    curve = replace(curve, n0_sd_cps=N0_SHARE * curve.n0_cps)
    true_curve = replace(curve, n0_cps=curve.n0_cps * (1 + error))
    truth = true_curve.vwc(result.truth_rate[mask])
    stress = float(np.nanquantile(truth, (0.1, 0.9)).mean())
    limits = {"wilting_point": stress - ABOVE, "field_capacity": stress + ABOVE}
    one = DoseSettings(**limits, root_depth_mm=DEPTH_MM, steps_mm=STEPS_MM, width_m=WIDTH_M)
    need = np.where(truth < stress, (one.full - truth) * DEPTH_MM, 0.0)
    dose = find_dose(soil_map.rate[mask], soil_map.rate_sd[mask], curve, one)
    zones = zones_of_dose(dose, cells, soil_map.grid.cell_m, field_polygon(soil_map), one)
    found = []
    for plan in (np.full(len(cells), need.mean()), dose_at(zones, cells)):
        found += [float(np.maximum(sign * (plan - need), 0).sum() / need.sum()) for sign in (1, -1)]
    return found[0], found[1], found[2], found[3], zones_mean(zones, "sure")


def main() -> None:
    """Print or save the table."""
    options = results.parser(__doc__)
    options.add_argument("--draws", type=int, default=10, help="number of surveys of each kind (default: 10)")
    chosen = options.parse_args()
    rows = []
    for field in FIELDS:
        for hours in HOURS:
            found = np.mean([shares(field, hours, seed) for seed in range(chosen.draws)], axis=0)
            rows.append([field, f"{hours:g}", *(f"{100 * share:.0f} %" for share in found[:4].tolist())])
            print(rows[-1], found[4], flush=True)
    columns = ("field", "hours", "uniform: too much", "uniform: missed", "zones: too much", "zones: missed")
    results.publish(
        "dose", columns, rows, f"means of {chosen.draws} surveys, machine of {WIDTH_M:g} m", chosen.save
    )


if __name__ == "__main__":
    main()
