# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Calibration against soil cores: N0 and its uncertainty, written into the site file."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

from ruamel.yaml import YAML

from soilmoist_ros.foundation import InputError, read_yaml
from soilmoist_ros.sensing.moisture.curve import MoistureCurve
from soilmoist_ros.sensing.moisture.site import Calibration, Soil, load_site
from soilmoist_ros.sensing.moisture.soil_limits import soil_limits


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


def estimate_n0(
    rate_cps: float, rate_sd_cps: float, vwc: float, vwc_sd: float, unit_curve: MoistureCurve
) -> N0Estimate:
    """N0 in closed form, and its first-order standard deviation from counting and from the cores.

    :param rate_cps: corrected rate at the calibration [counts/s], > 0
    :param rate_sd_cps: standard deviation of the rate [counts/s], ``rate / sqrt(raw counts)``
    :param vwc: soil moisture of the cores [m^3/m^3]
    :param vwc_sd: standard deviation of ``vwc`` [m^3/m^3]; if NaN, the result includes only counting
    :param unit_curve: curve of the site with an N0 of 1 count/s
    :raises ValueError: if the rate is not positive or the moisture is out of the curve's range
    """
    if not (math.isfinite(rate_cps) and rate_cps > 0):
        raise ValueError(f"the calibration rate must be positive and finite, got {rate_cps}")
    unit_rate = float(unit_curve.rate_cps(vwc))
    n0 = rate_cps / unit_rate
    counting = rate_sd_cps / unit_rate
    # d(N0)/d(vwc) = -(N0/N) dN/d(vwc), and dN/d(vwc) is N0 over the slope of the curve with an N0 of 1.
    cores = abs(n0 / unit_rate / float(unit_curve.slope(unit_rate))) * vwc_sd
    total = math.hypot(counting, 0.0 if math.isnan(cores) else cores)
    return N0Estimate(n0, total, counting, cores)


USUAL_N0_CPS = (0.05, 30.0)
"""N0 of sensors from one small tube at sea level to twelve large ones in the mountains [counts/s]."""
OTHER_TIMES = {"hour": 3600.0, "minute": 60.0, "10 s": 10.0}
"""Times per which other programs give N0 [s]."""


def unusual_n0(n0_cps: float) -> str:
    """Doubt about an N0 that no sensor has; empty for a usual one.

    >>> unusual_n0(1111.0)
    'N0 of 1111 counts/s is unusual: 0.3086 counts/s if it is per hour, 18.52 counts/s if it is per minute'
    """
    low, high = USUAL_N0_CPS
    if low <= n0_cps <= high:
        return ""
    per = ((time, n0_cps / time_s) for time, time_s in OTHER_TIMES.items())
    meant = [f"{n0:.4g} counts/s if it is per {time}" for time, n0 in per if low <= n0 <= high]
    return f"N0 of {n0_cps:g} counts/s is unusual{': ' + ', '.join(meant) if meant else ''}"


def n0_in_other_time(rate_cps: float, curve: MoistureCurve) -> str:
    """Doubt about an N0 per hour, minute or 10 s instead of per second; empty if the rate fits N0 as it is.

    :param rate_cps: mean corrected rate of a survey [counts/s]
    :param curve: curve with the N0 in doubt
    """
    limits = soil_limits(curve.bulk_density_gcm3)
    most, least = (float(curve.rate_cps(vwc)) / curve.n0_cps for vwc in (limits.dryness, limits.saturation))
    if least <= rate_cps / curve.n0_cps <= most:
        return ""
    for time, time_s in OTHER_TIMES.items():
        if least <= rate_cps * time_s / curve.n0_cps <= most:
            meant = f"per {time}: {curve.n0_cps / time_s:.4g} counts/s"
            return f"N0 of {curve.n0_cps:g} counts/s fits these counts if it is {meant}"
    return ""


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
