# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs crnpy and neptoon on the public record of the station in Kansas, and compares them with this package.

usage: .venv/bin/python scripts/compare_programs.py NEPTOON_PYTHON [--save]

NEPTOON_PYTHON is the Python of an environment with neptoon: ``python3 -m venv nep``, then ``nep/bin/pip install
neptoon``. It runs this file, too, with ``--neptoon``: JSON of record, cores and settings in, JSON out. Prints two
tables: the same settings in all programs, and each program its own way, from the record to the moisture.
"""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
import tempfile
from datetime import UTC, datetime, timedelta
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

if "--neptoon" not in sys.argv[1:]:  # the other environment has none of these
    import crnpy
    import results

    from soilmoist_ros.sensing import Site, load_site, process_logs, read_log
    from soilmoist_ros.sensing.corrections.factors import absolute_humidity_gm3
    from soilmoist_ros.sensing.moisture.cores import read_soil_cores

ROOT = Path(__file__).resolve().parent.parent
LOG = ROOT / "examples" / "station_kansas_2021-10.dat"
CORES = ROOT / "examples" / "station_kansas_cores.csv"
SITE = ROOT / "config" / "sites" / "station_kansas.yaml"
FROM, TO = "2021-10-22T06:00", "2021-10-23T06:00"  # hours of the calibration, UTC
BLOCK_H = 6
Array = NDArray[np.float64]


def read_record() -> tuple[dict[str, Array], Array]:
    """Columns of the log as they are, both tubes added; and the time [s since 1970 UTC] of each row's end."""
    with LOG.open(encoding="utf-8", newline="") as stream:
        next(stream)
        names = next(csv.reader(stream))
        rows = [dict(zip(names, row, strict=True)) for row in list(csv.reader(stream))[2:]]
    column = {name: np.array([float(row[name]) for row in rows]) for name in names[10:12] + names[19:23]}
    local = [datetime.fromisoformat(row["TIMESTAMP"]) + timedelta(hours=6) for row in rows]
    record = {
        "counts": column["counts_1_Tot"] + column["counts_2_Tot"],
        "pressure_hpa": column["barometric_pressure_Avg"],
        "temperature_degc": column["air_temperature_Avg"],
        "relative_humidity": column["relative_humidity_Avg"],
    }
    return record, np.array([time.replace(tzinfo=UTC).timestamp() for time in local])


def middles(folder: Path) -> Path:
    """The cores with the depths of their middles, as the other programs take them."""
    path = folder / "middles.csv"
    with CORES.open(encoding="utf-8", newline="") as stream, path.open("w", encoding="utf-8", newline="") as made:
        rows = list(csv.DictReader(stream))
        for row in rows:
            row["depth_cm"] = str((float(row.pop("top_cm")) + float(row.pop("bottom_cm"))) / 2)
        table = csv.DictWriter(made, list(rows[0]))
        table.writeheader()
        table.writerows(rows)
    return path


def calibrated(curve: str, cores: Path, folder: Path) -> Site:
    """The site of the station, calibrated by ``soilmoist calibrate`` with soil cores."""
    path = folder / f"{curve}_{cores.stem}.yaml"
    shutil.copyfile(SITE, path)
    soilmoist = Path(sys.executable).with_name("soilmoist")
    arguments = ["--site", path, "--log", LOG, "--from", FROM, "--to", TO, "--curve", curve]
    subprocess.run([soilmoist, "calibrate", cores, *arguments], check=True, capture_output=True)
    return load_site(path)


def ours(site: Site, stamps: Array) -> dict[str, Array]:
    """Factors, rates and moisture of this package at the rows of the log; NaN where a record is lost."""
    survey = process_logs([read_log(LOG, utc_offset_hours=site.logger_utc_offset_hours)], site)
    at = {round(record.stamp_s): record for record in survey.records}
    found = [at.get(round(stamp)) for stamp in stamps]
    series = {
        name: np.array([np.nan if record is None else getattr(record, name) for record in found])
        for name in ("f_pressure", "f_humidity", "corrected_rate", "raw_counts", "effective_exposure_s")
    }
    rate = series["corrected_rate"]
    assert site.curve is not None
    series["vwc"], series["vwc_sd"] = site.curve.vwc_and_sd(rate, np.sqrt(rate / series["effective_exposure_s"]))
    return series


def crnpy_rates(record: dict[str, Array], beta_per_hpa: float, reference_hpa: float) -> dict[str, Array]:
    """Factors and corrected rates of crnpy."""
    humidity = crnpy.abs_humidity(record["relative_humidity"], record["temperature_degc"])
    f_pressure = crnpy.correction_pressure(record["pressure_hpa"], reference_hpa, 1 / beta_per_hpa)
    f_humidity = crnpy.correction_humidity(humidity, 0.0)
    return {
        "absolute_humidity_gm3": humidity,
        "f_pressure": 1 / f_pressure,  # crnpy divides by it
        "f_humidity": f_humidity,
        "rate_cps": record["counts"] / 3600 * f_humidity / f_pressure,
    }


def crnpy_cores(cores: dict[str, Any], humidity_gm3: float, pressure_hpa: float, density: float) -> float:
    """Mean of the cores by the weights of crnpy [m3/m3]."""
    mean, _ = crnpy.nrad_weight(
        humidity_gm3, cores["vwc"], cores["distance_m"], cores["middle_cm"], cores["profile"], rhob=density,
        p=pressure_hpa, tol=1e-9,
    )  # fmt: skip
    return float(mean)


def blocks(values: Array) -> Array:
    """Means of six hours."""
    whole = len(values) // BLOCK_H * BLOCK_H
    return np.nanmean(np.asarray(values)[:whole].reshape(-1, BLOCK_H), axis=1)


def difference(ours: Array, theirs: Array, relative: bool) -> str:
    """Largest difference as a number with its sign taken off."""
    good = np.isfinite(ours) & np.isfinite(theirs)
    largest = np.max(np.abs(theirs[good] - ours[good]) / (np.abs(ours[good]) if relative else 1))
    return f"{largest:.1e}" + (" relative" if relative else "")


def compare(neptoon_python: str, save: bool) -> None:
    """Make both tables."""
    record, stamps = read_record()
    start, end = (datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp() for text in (FROM, TO))
    during = (stamps > start) & (stamps <= end)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sites = {curve: calibrated(curve, CORES, folder) for curve in ("desilets", "universal")}
        sites["middles"] = calibrated("desilets", middles(folder), folder)
    site, of_curve = sites["desilets"], {curve: ours(of, stamps) for curve, of in sites.items()}
    mine, settings = of_curve["desilets"], site.corrections_parameters
    assert site.soil is not None
    assert site.calibration is not None
    assert site.location is not None
    soil = {key: getattr(site.soil, key) for key in ("bulk_density_gcm3", "lattice_water", "organic_water")}
    listed = read_soil_cores(CORES).cores
    cores = {
        "vwc": np.array([core.vwc for core in listed]),
        "distance_m": np.array([core.distance_m for core in listed]),
        "middle_cm": np.array([(core.top_cm + core.bottom_cm) / 2 for core in listed]),
        "profile": np.array([core.profile for core in listed]),
    }
    rigidity_gv = float(crnpy.cutoff_rigidity(site.location.latitude_deg, site.location.longitude_deg))
    task = {
        "record": {key: values.tolist() for key, values in record.items()},
        "cores": {key: values.tolist() for key, values in cores.items()},
        "calibration_hours": during.tolist(),
        "soil": soil,
        "place": {"latitude_deg": site.location.latitude_deg, "altitude_m": site.location.altitude_m},
        "same": {
            "beta_per_hpa": settings.beta_per_hpa,
            "reference_hpa": settings.reference_pressure_hpa,
            "n0_cps": site.calibration.n0_cps,
            "cutoff_rigidity_gv": rigidity_gv,
        },
    }
    run = subprocess.run(
        [neptoon_python, __file__, "--neptoon"],
        input=json.dumps(task), capture_output=True, text=True, check=False,
    )  # fmt: skip
    if run.returncode != 0:
        raise SystemExit(run.stderr)
    neptoon = json.loads(run.stdout)
    theirs = crnpy_rates(record, settings.beta_per_hpa, settings.reference_pressure_hpa)
    bound = (soil["lattice_water"], soil["organic_water"], soil["bulk_density_gcm3"])
    theirs["vwc"] = crnpy.counts_to_vwc(theirs["rate_cps"], site.calibration.n0_cps, *bound)
    theirs["vwc_sd"] = crnpy.uncertainty_vwc(
        record["counts"], site.calibration.n0_cps * 3600, soil["bulk_density_gcm3"],
        fp=1 / theirs["f_pressure"], fw=theirs["f_humidity"],
    )  # fmt: skip

    whole = np.isclose(mine["raw_counts"], record["counts"])  # hours without a masked tube
    mine["absolute_humidity_gm3"] = np.array(
        [
            absolute_humidity_gm3(degc, percent / 100)
            for degc, percent in zip(record["temperature_degc"], record["relative_humidity"], strict=True)
        ]
    )
    mine["rate_cps"] = mine["corrected_rate"]
    rows = [["quantity", f"crnpy {version('crnpy')}", f"neptoon {neptoon['version']}"]]
    for key, label, relative in (
        ("absolute_humidity_gm3", "absolute humidity [g/m³]", False),
        ("f_pressure", "pressure factor", True),
        ("f_humidity", "humidity factor", True),
        ("rate_cps", "corrected rate", True),
        ("vwc", "moisture, Desilets [m³/m³]", False),
        ("vwc_sd", "its standard deviation [m³/m³]", False),
    ):
        mine_whole = np.where(whole, mine[key], np.nan)
        rows.append([label, *(difference(mine_whole, np.array(of[key]), relative) for of in (theirs, neptoon))])
    about = "largest differences from soilmoist_ros of all hours, settings of config/sites/station_kansas.yaml"
    results.publish("programs_same", rows[0], rows[1:], about, save)

    reference_hpa, beta = float(record["pressure_hpa"].mean()), 1 / 130
    own = crnpy_rates(record, beta, reference_hpa)
    humidity_gm3 = float(own["absolute_humidity_gm3"][during].mean())
    mean = crnpy_cores(
        cores, humidity_gm3, float(record["pressure_hpa"][during].mean()), soil["bulk_density_gcm3"]
    )
    water = mean / soil["bulk_density_gcm3"] + soil["lattice_water"] + soil["organic_water"]
    n0 = float(own["rate_cps"][during].mean() / (0.0808 / (water + 0.115) + 0.372))
    own_vwc = crnpy.counts_to_vwc(own["rate_cps"], n0, *bound)
    note = {
        curve: of.calibration.note.split("mean VWC ")[1].split()[0]
        for curve, of in sites.items()
        if of.calibration
    }
    series = {
        "soilmoist_ros, Desilets": (
            settings.reference_pressure_hpa, settings.beta_per_hpa, note["desilets"],
            site.calibration.n0_cps, mine["vwc"],
        ),
        "soilmoist_ros, universal": (
            settings.reference_pressure_hpa, settings.beta_per_hpa, note["universal"],
            sites["universal"].calibration.n0_cps, of_curve["universal"]["vwc"],
        ),
        "soilmoist_ros, Desilets, cores at their middles": (
            settings.reference_pressure_hpa, settings.beta_per_hpa, note["middles"],
            sites["middles"].calibration.n0_cps, of_curve["middles"]["vwc"],
        ),
        "crnpy, Desilets": (reference_hpa, beta, f"{mean:.3f}", n0, own_vwc),
        "neptoon, Desilets": (
            neptoon["reference_hpa"], neptoon["beta_per_hpa"], f"{neptoon['mean_of_cores']:.3f}",
            neptoon["own"]["desilets"]["n0_cps"], np.array(neptoon["own"]["desilets"]["vwc"]),
        ),
        "neptoon, universal": (
            neptoon["reference_hpa"], neptoon["beta_per_hpa"], f"{neptoon['mean_of_cores']:.3f}",
            neptoon["own"]["universal"]["n0_cps"], np.array(neptoon["own"]["universal"]["vwc"]),
        ),
    }  # fmt: skip
    rows = [
        [
            "program, curve", "P0 [hPa]", "β [1/hPa]", "cores [m³/m³]", "N0 [counts/s]", "mean [m³/m³]",
            "minimum", "maximum", "largest difference from the first",
        ]
    ]  # fmt: skip
    base = blocks(mine["vwc"])
    for label, (reference, coefficient, of_cores, n0_cps, vwc) in series.items():
        six = blocks(vwc)
        rows.append(
            [
                label, f"{reference:.1f}", f"{coefficient:.5f}", of_cores, f"{n0_cps:.4f}", f"{np.mean(six):.3f}",
                f"{np.min(six):.3f}", f"{np.max(six):.3f}", f"{np.max(np.abs(six - base)):.3f}",
            ]
        )  # fmt: skip
    about = "moistures are means of six hours; the same cores and the same day"
    results.publish("programs_own", rows[0], rows[1:], about, save)
    print(f"cutoff rigidity {rigidity_gv:.2f} GV (crnpy); hours with a masked tube: {int(np.sum(~whole[1:]))}")


def run_neptoon() -> None:
    """What neptoon computes, as JSON; runs in an environment that has it."""
    from neptoon.formulas import calibration, humidity, pressure, soil_moisture

    task = json.load(sys.stdin)
    record = {name: np.array(values, dtype=float) for name, values in task["record"].items()}
    cores = {name: np.array(values) for name, values in task["cores"].items()}
    same, place, soil = task["same"], task["place"], task["soil"]
    bound = soil["lattice_water"] + soil["organic_water"]
    during = np.array(task["calibration_hours"], dtype=bool)
    weights = calibration.Schroen2017

    def humidity_gm3_of_rows():
        """From temperature and relative humidity, by neptoon's formulas."""
        saturated = humidity.calc_saturation_vapour_pressure(record["temperature_degc"])
        actual = humidity.calc_actual_vapour_pressure(saturated, record["relative_humidity"])
        return humidity.calc_absolute_humidity(actual, record["temperature_degc"])

    def corrected_cps(beta_per_hpa, reference_hpa):
        """Rates of all tubes together, corrected for pressure and humidity, with both factors."""
        by_pressure = pressure.calc_pressure_correction_factor(record["pressure_hpa"], reference_hpa, beta_per_hpa)
        by_humidity = humidity.humidity_correction_rosolem2013(humidity_gm3_of_rows())
        return record["counts"] / 3600 * by_pressure * by_humidity, by_pressure, by_humidity

    def mean_of_cores(tolerance=1e-9):
        """Mean moisture as the probe sees it [m3/m3]: neptoon's weights, each core at its middle."""
        vwc, density = cores["vwc"].astype(float), soil["bulk_density_gcm3"]
        humidity_gm3, pressure_hpa = humidity_gm3_of_rows()[during].mean(), record["pressure_hpa"][during].mean()
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
                rate_cps, n0_cps, humidity_gm3_of_rows(), bound, "Mar21_mcnp_drf"
            )
        return np.asarray(water) * soil["bulk_density_gcm3"]

    def n0_of(rate_cps, vwc, curve):
        """N0 that gives the mean moisture of the cores with the mean rate of the calibration."""
        theory = {"desilets": "desilets_etal_2010", "universal": "koehli_etal_2021"}[curve]
        more = {} if curve == "desilets" else {"koehli_parameters": "Mar21_mcnp_drf"}
        water, humidity_gm3 = vwc / soil["bulk_density_gcm3"], humidity_gm3_of_rows()[during].mean()
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
        rate,
        np.sqrt(record["counts"]) / 3600 * by_pressure * by_humidity,
        same["n0_cps"],
        soil["bulk_density_gcm3"],
    )
    json.dump(
        {
            "version": version("neptoon"),
            "absolute_humidity_gm3": np.asarray(humidity_gm3_of_rows()).tolist(),
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


if __name__ == "__main__":
    if "--neptoon" in sys.argv[1:]:
        run_neptoon()
    else:
        parser = results.parser(__doc__)
        parser.add_argument("neptoon_python", help="interpreter of an environment with neptoon")
        given = parser.parse_args()
        compare(given.neptoon_python, given.save)
