# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The part of scripts/compare_programs.py that runs with neptoon, in an environment that has it.

Reads record, cores and settings as JSON from the standard input, and prints what neptoon computes as JSON.
"""

import json
import sys
from importlib.metadata import version

import numpy as np
from neptoon.formulas import calibration, humidity, pressure, soil_moisture

task = json.load(sys.stdin)
record = {name: np.array(values, dtype=float) for name, values in task["record"].items()}
cores = {name: np.array(values) for name, values in task["cores"].items()}
same, place, soil = task["same"], task["place"], task["soil"]
bound = soil["lattice_water"] + soil["organic_water"]
during = np.array(task["calibration_hours"], dtype=bool)
weights = calibration.Schroen2017


def absolute_humidity_gm3():
    """From temperature and relative humidity, by neptoon's formulas."""
    saturated = humidity.calc_saturation_vapour_pressure(record["temperature_degc"])
    actual = humidity.calc_actual_vapour_pressure(saturated, record["relative_humidity"])
    return humidity.calc_absolute_humidity(actual, record["temperature_degc"])


def corrected_cps(beta_per_hpa, reference_hpa):
    """Rates of all tubes together, corrected for pressure and humidity, with both factors."""
    by_pressure = pressure.calc_pressure_correction_factor(record["pressure_hpa"], reference_hpa, beta_per_hpa)
    by_humidity = humidity.humidity_correction_rosolem2013(absolute_humidity_gm3())
    return record["counts"] / 3600 * by_pressure * by_humidity, by_pressure, by_humidity


def mean_of_cores(tolerance=1e-9):
    """Mean moisture as the probe sees it [m3/m3]: neptoon's weights, each core at its middle."""
    vwc, density = cores["vwc"].astype(float), soil["bulk_density_gcm3"]
    humidity_gm3, pressure_hpa = absolute_humidity_gm3()[during].mean(), record["pressure_hpa"][during].mean()
    mean = vwc.mean()
    while True:
        profiles, shares = [], []
        for name in np.unique(cores["profile"]):
            of = cores["profile"] == name
            near = weights.rescale_distance(cores["distance_m"].astype(float)[of][0], pressure_hpa, 0, mean)
            depth = weights.vertical_weighting(cores["middle_cm"].astype(float)[of], near, density, mean)
            profiles.append(np.average(vwc[of], weights=depth))
            shares.append(weights.horizontal_weighting(near, mean, humidity_gm3))
        new = float(np.average(profiles, weights=shares))
        if abs(new - mean) < tolerance:
            return new
        mean = new


def vwc_of(rate_cps, n0_cps, curve):
    """Moisture [m3/m3] from corrected rates; Köhli's curve takes rates that are not corrected for humidity."""
    if curve == "desilets":
        water = soil_moisture.neutrons_to_grav_soil_moisture_desilets_etal_2010(rate_cps, n0_cps, bound)
    else:
        water = soil_moisture.neutrons_to_grav_soil_moisture_koehli_etal_2021(
            rate_cps, n0_cps, absolute_humidity_gm3(), bound, "Mar21_mcnp_drf"
        )
    return np.asarray(water) * soil["bulk_density_gcm3"]


def n0_of(rate_cps, vwc, curve):
    """N0 that gives the mean moisture of the cores with the mean rate of the calibration."""
    theory = {"desilets": "desilets_etal_2010", "universal": "koehli_etal_2021"}[curve]
    more = {} if curve == "desilets" else {"koehli_parameters": "Mar21_mcnp_drf"}
    water, humidity_gm3 = vwc / soil["bulk_density_gcm3"], absolute_humidity_gm3()[during].mean()
    return float(soil_moisture.find_n0(water, rate_cps[during].mean(), humidity_gm3, bound, theory, **more))


rate, by_pressure, by_humidity = corrected_cps(same["beta_per_hpa"], same["reference_hpa"])
beta = float(
    pressure.calc_beta_coefficient_desilets_2021(
        place["latitude_deg"], place["altitude_m"], same["cutoff_rigidity_gv"]
    )
)
reference = float(pressure.calc_mean_pressure(place["altitude_m"]))
own_rate, _, own_humidity = corrected_cps(beta, reference)
vwc = mean_of_cores()
own = {}
for curve in ("desilets", "universal"):
    counted = own_rate if curve == "desilets" else own_rate / own_humidity
    n0 = n0_of(counted, vwc, curve)
    own[curve] = {"n0_cps": n0, "vwc": vwc_of(counted, n0, curve).tolist()}
uncertainty = soil_moisture.calculate_desilets_etal_2010_volumetric_sm_uncertainty_percent(
    rate, np.sqrt(record["counts"]) / 3600 * by_pressure * by_humidity, same["n0_cps"], soil["bulk_density_gcm3"]
)
json.dump(
    {
        "version": version("neptoon"),
        "absolute_humidity_gm3": np.asarray(absolute_humidity_gm3()).tolist(),
        "f_pressure": np.asarray(by_pressure).tolist(),
        "f_humidity": np.asarray(by_humidity).tolist(),
        "rate_cps": rate.tolist(),
        "vwc": vwc_of(rate, same["n0_cps"], "desilets").tolist(),
        "vwc_sd": (np.asarray(uncertainty) / 100).tolist(),
        "beta_per_hpa": beta,
        "reference_hpa": reference,
        "mean_of_cores": vwc,
        "own": own,
    },
    sys.stdout,
)
