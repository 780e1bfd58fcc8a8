"""Calibration against soil cores: N0 and its uncertainty, written into the site file."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML

from soilmoist_ros.foundation.configuration import read_yaml
from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, n0_from_calibration
from soilmoist_ros.sensing.moisture.site import Calibration, Soil, load_site

_COLUMNS = ("vwc", "gravimetric_water", "bulk_density_gcm3", "weight")
_DENSEST_SOIL_GCM3 = 2.8


@dataclass(frozen=True)
class SoilCores:
    """Moisture and density from the soil cores of a calibration.

    :param vwc: weighted mean volumetric water content [m^3/m^3]
    :param vwc_sd: standard error of ``vwc`` [m^3/m^3]; NaN for a single core
    :param bulk_density_gcm3: weighted mean dry bulk density [g/cm^3], ``None`` if unknown
    :param count: number of cores
    """

    vwc: float
    vwc_sd: float
    bulk_density_gcm3: float | None
    count: int


@dataclass(frozen=True)
class N0Estimate:
    """N0 with its uncertainty and the sources of the uncertainty.

    :param n0_cps: count rate over dry soil [counts/s]
    :param n0_sd_cps: standard deviation of N0 [counts/s]
    :param from_counting_cps: part of the standard deviation from counting [counts/s]
    :param from_cores_cps: part of the standard deviation from the cores [counts/s]; NaN if unknown
    """

    n0_cps: float
    n0_sd_cps: float
    from_counting_cps: float
    from_cores_cps: float


def read_soil_cores(path: Path, bulk_density_gcm3: float | None = None) -> SoilCores:
    """Read a CSV of soil cores, one row per core.

    Columns, by name in the first line: ``vwc`` [m^3/m^3], or ``gravimetric_water`` [g/g] together with a bulk
    density; optionally ``bulk_density_gcm3`` and ``weight`` (for example the sensor's sensitivity at the core's
    distance and depth). Other columns are ignored.

    :param bulk_density_gcm3: density for gravimetric values of cores without a density
    :raises InputError: with every mistake in the file
    """
    rows = _read_rows(path)
    values: list[tuple[float, float, float]] = []  # vwc, density, weight
    mistakes: list[Mistake] = []
    for line, row in rows:
        try:
            values.append(_core(row, bulk_density_gcm3))
        except _CellError as fault:
            mistakes.append(Mistake(fault.message, fault.remedy, path, line, fault.column))
    if mistakes:
        raise InputError(mistakes)
    if not values:
        raise InputError("has no soil core", "add one row per core below the header", path)
    vwc, density, weight = np.array(values).T
    if weight.sum() <= 0:
        raise InputError("all weights are zero", "give at least one core a positive weight", path)
    share = weight / weight.sum()
    mean = float(share @ vwc)
    effective = 1 / float(share @ share)
    spread = float(share @ (vwc - mean) ** 2)
    error = math.sqrt(spread / (effective - 1)) if effective > 1 + 1e-9 else math.nan
    known = np.isfinite(density)
    mean_density = float(np.average(density[known], weights=share[known])) if share[known].sum() > 0 else None
    return SoilCores(mean, error, mean_density, len(values))


def estimate_n0(rate_cps: float, rate_sd_cps: float, vwc: float, vwc_sd: float, soil: Soil) -> N0Estimate:
    """N0 in closed form, and its first-order standard deviation from counting and from the cores.

    :param rate_cps: corrected rate at the calibration [counts/s], > 0
    :param rate_sd_cps: standard deviation of the rate [counts/s], ``rate / sqrt(raw counts)``
    :param vwc: soil moisture of the cores [m^3/m^3]
    :param vwc_sd: standard deviation of ``vwc`` [m^3/m^3]; if NaN, the result includes only counting
    :raises ValueError: if the rate is not positive or the moisture is out of the curve's range
    """
    properties = (soil.bulk_density_gcm3, soil.lattice_water, soil.organic_water)
    n0 = n0_from_calibration(rate_cps, vwc, *properties)
    # On the curve of this N0, d(N0)/d(vwc) = -(N0/N) dN/d(vwc), and dN/d(vwc) is one over the curve's slope.
    slope = float(CalibrationCurve(n0, *properties).slope(rate_cps))
    counting = n0 * rate_sd_cps / rate_cps
    cores = abs(n0 / rate_cps / slope) * vwc_sd
    total = math.hypot(counting, 0.0 if math.isnan(cores) else cores)
    return N0Estimate(n0, total, counting, cores)


def write_calibration(site_file: Path, calibration: Calibration, soil: Soil | None = None) -> None:
    """Write a calibration (and soil properties, if given) into a site file, preserving comments and order.

    The file is replaced atomically: a crash leaves either the old or the new file.

    :raises InputError: if the file cannot be read or written
    """
    content = read_yaml(site_file)
    content["calibration"] = calibration.model_dump(exclude_defaults=True)
    if soil is not None:
        content["soil"] = soil.model_dump(exclude_none=True)
    text = StringIO()
    yaml = YAML(typ="rt")
    yaml.width = 120
    yaml.dump(content, text)
    temporary = site_file.with_name(site_file.name + ".tmp")
    try:
        temporary.write_text(text.getvalue(), encoding="utf-8")
        load_site(temporary)  # an unreadable file must not replace a valid one
        os.replace(temporary, site_file)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "check its permissions", site_file) from None
    finally:
        temporary.unlink(missing_ok=True)


class _CellError(Exception):
    def __init__(self, column: str, message: str, remedy: str) -> None:
        super().__init__(message)
        self.column, self.message, self.remedy = column, message, remedy


def _read_rows(path: Path) -> list[tuple[int, dict[str, str]]]:
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", "check the path of the cores", path) from None
    except UnicodeDecodeError:
        raise InputError("is not UTF-8 text", "save the table as CSV in UTF-8", path) from None
    lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
    numbers = [n for n, line in enumerate(text.splitlines(), 1) if not line.lstrip().startswith("#")]
    delimiter = ";" if lines and lines[0].count(";") > lines[0].count(",") else ","
    table = list(csv.reader(lines, delimiter=delimiter))
    header = [cell.strip().lower() for cell in table[0]] if table else []
    if "vwc" not in header and "gravimetric_water" not in header:
        raise InputError(
            f"has no column 'vwc' or 'gravimetric_water', only: {', '.join(filter(None, header)) or 'nothing'}",
            f"name the columns in the first line; known are: {', '.join(_COLUMNS)}",
            path,
        )
    return [
        (numbers[i], dict(zip(header, (cell.strip() for cell in row), strict=False)))
        for i, row in enumerate(table)
        if i > 0 and any(cell.strip() for cell in row)
    ]


def _core(row: dict[str, str], default_density: float | None) -> tuple[float, float, float]:
    density = _number(row, "bulk_density_gcm3", 0.1, _DENSEST_SOIL_GCM3, "dry bulk density is in g/cm^3")
    weight = _number(row, "weight", 0, math.inf, "a weight is zero or positive")
    vwc = _number(row, "vwc", 0, 1, "volumetric water content is a fraction, not per cent")
    if vwc is None:
        gravimetric = _number(row, "gravimetric_water", 0, 3, "gravimetric water is in g/g, not per cent")
        if gravimetric is None:
            raise _CellError(
                "vwc", "the core has no moisture", "fill in vwc or gravimetric_water, or drop the row"
            )
        used = density if density is not None else default_density
        if used is None:
            raise _CellError(
                "bulk_density_gcm3",
                "gravimetric water needs a bulk density",
                "add the column, or 'soil: {bulk_density_gcm3: ...}' to the site file",
            )
        vwc = gravimetric * used
        if vwc > 1:
            raise _CellError("gravimetric_water", f"gives {vwc:.2f} m^3 of water per m^3", "check both values")
    return vwc, math.nan if density is None else density, 1.0 if weight is None else weight


def _number(row: dict[str, str], column: str, low: float, high: float, remedy: str) -> float | None:
    text = row.get(column, "")
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        raise _CellError(column, f"{text!r} is not a number", remedy) from None
    if not (math.isfinite(value) and low <= value <= high):
        raise _CellError(column, f"{text} is outside {low:g} to {high:g}", remedy)
    return value


def pooled_rate(raw_counts: Sequence[int], effective_exposure_s: Sequence[float]) -> tuple[float, float]:
    """Corrected rate of all records together, and standard deviation of the rate [counts/s].

    :raises ValueError: without any count or exposure
    """
    counts, exposure = sum(raw_counts), math.fsum(effective_exposure_s)
    if counts <= 0 or exposure <= 0:
        raise ValueError("there is no count to calibrate with")
    return counts / exposure, math.sqrt(counts) / exposure
