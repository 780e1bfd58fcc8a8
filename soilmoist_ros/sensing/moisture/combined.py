# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""N0 from several sources, combined by their uncertainties in log N0.

The general calibration, and an earlier calibration of this sensor at *another* site, are wrong here by the same
part: by how this site differs from others. This part is taken as common, so that they do not seem twice as sure.
Errors of bulk density and bound water are in none of the deviations: the curve carries them, with their effect on
the N0 of the cores, which were compared by it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from soilmoist_ros.foundation import InputError, distance_and_bearing, listing
from soilmoist_ros.sensing.moisture.general import DAY_SD, GENERAL_SD
from soilmoist_ros.sensing.moisture.site import Calibration, N0Estimate, Site, UncertaintyPart

PROFILE_SD = 0.05
"""Standard deviation of the moisture of one profile about the mean of its footprint, an assumption where nothing
shows it [m^3/m^3]. Famiglietti et al. (2008, Water Resources Research 44, W01423): 0.036 over 2.5 m to 0.071 over
50 km; footprints of 10 to 200 m lie in between."""
PROFILE_DENSITY_SD_GCM3 = 0.12
"""Standard deviation of the bulk density of one profile, an assumption: that of cropland sites [g/cm^3]."""
SAME_SITE_M = 300.0
"""Distance up to which two calibrations are of one site, about the reach of a bare probe [m]."""
DISAGREEMENT_SD = 2.0
"""Difference of two sources, in its standard deviations, from which they contradict each other."""


class N0Source(NamedTuple):
    """One source of N0.

    :param n0_cps: its N0 [counts/s]
    :param sd: standard deviation of log N0, > 0
    :param site_sd: part of ``sd`` that all sources share which know the general level, but not this site; 0 for
        cores of this site
    """

    name: str
    n0_cps: float
    sd: float
    site_sd: float = 0.0


class CombinedN0(NamedTuple):
    """N0 of several sources together.

    :param n0_cps: N0 [counts/s]
    :param sd: standard deviation of log N0
    :param weights: weight of each source, their sum is 1
    :param shares: standard deviation of log N0 by each source; their squares add up to that of ``sd``
    """

    n0_cps: float
    sd: float
    weights: tuple[float, ...]
    shares: tuple[float, ...]


def combine_n0(sources: Sequence[N0Source]) -> CombinedN0:
    """Best linear unbiased combination of log N0: inverse variances, with the common part as covariance.

    >>> both = combine_n0([N0Source("general", 1.0, 0.06), N0Source("cores", 1.1, 0.02)])
    >>> round(both.n0_cps, 3), round(both.sd, 4), [round(weight, 2) for weight in both.weights]
    (1.09, 0.019, [0.1, 0.9])

    :param sources: at least one
    :raises ValueError: if a standard deviation is not positive, or smaller than its common part
    """
    sd, common = (np.array([getattr(one, name) for one in sources]) for name in ("sd", "site_sd"))
    if not (np.isfinite(sd).all() and (sd > 0).all() and (common <= sd).all()):
        raise ValueError(f"standard deviations must be positive and include their common part, got {sources}")
    covariance = np.multiply.outer(common, common)
    np.fill_diagonal(covariance, sd**2)
    weights = np.linalg.lstsq(covariance, np.ones(len(sd)), rcond=None)[0]
    weights /= weights.sum()
    level = float(weights @ np.log([one.n0_cps for one in sources]))
    # Each source gets its own variance and half of each covariance, so that the shares add up.
    of_each = weights * (covariance @ weights)
    return CombinedN0(
        math.exp(level), math.sqrt(of_each.sum()), tuple(weights.tolist()), tuple(np.sqrt(of_each).tolist())
    )


def earlier_source(
    before: Site, path: Path, here: Site, days: Sequence[str], scale: Callable[[], float]
) -> N0Source:
    """What an earlier calibration of the same sensor says of a site.

    At another site the scatter between sites (:data:`GENERAL_SD`) acts twice, once at each site. At the same
    site days scatter by :data:`DAY_SD`.

    :param before: site with the earlier calibration, ``path`` is its file; ``here``: the site to calibrate
    :param days: days of the present cores
    :param scale: N0 of the general calibration here divided by that there; called for another site
    :raises InputError: if the calibration is not of use, or of the same cores
    """
    found = before.calibration
    if found is None or found.illustrative:
        raise InputError("has no calibration, or a guess", "give a site file that soilmoist calibrate wrote", path)
    of_cores = next((part for part in found.parts if part.name == "cores" and part.origin != "given"), None)
    if found.method == "general" or (found.method == "combined" and of_cores is None):
        raise InputError("has a general calibration: it is counted already", "give one with soil cores", path)
    kind = here.calibration.curve if here.calibration is not None else "desilets"
    if found.curve != kind:
        raise InputError(
            f"its N0 is of the curve {found.curve}, not {kind}", "calibrate both with one curve", path
        )
    n0, sd = (of_cores.value, of_cores.sd) if of_cores is not None else (found.n0_cps, found.n0_sd_cps or 0.0)
    if not sd:
        raise InputError("its N0 has no n0_sd_cps, so it cannot be weighed", "add its standard deviation", path)
    there, place = before.location, here.location
    if there is None or place is None:
        raise InputError("it is not known whether it is the same site", "give both site files a location", path)
    ends = [(one.latitude_deg, one.longitude_deg) for one in (there, place)]
    if distance_and_bearing(ends[0], ends[1])[0] > SAME_SITE_M:
        factor = scale()
        return N0Source("earlier", n0 * factor, math.hypot(sd / n0, GENERAL_SD, GENERAL_SD), GENERAL_SD)
    if days and found.date and set(days) & set(found.date.split(", ")):
        raise InputError(f"is of the same day, {found.date}: its cores would count twice", "leave it out", path)
    return N0Source("earlier day", n0, math.hypot(sd / n0, DAY_SD))


def combined_calibration(
    alone: Calibration, cores: N0Estimate, sources: Sequence[N0Source], prior: Calibration | None, assumed: bool
) -> tuple[Calibration, CombinedN0]:
    """The calibration by several sources, with its parts: their shares add up to the standard deviation of N0.

    :param alone: calibration by the cores alone; ``cores`` its N0 and parts
    :param sources: the cores first, the general calibration second if there is a ``prior``, then earlier ones
    :param assumed: whether the error of the cores is an assumption
    """
    both = combine_n0(sources)
    counting = min(both.weights[0] * cores.from_counting_cps / cores.n0_cps, both.shares[0])
    of_cores = math.sqrt(both.shares[0] ** 2 - counting**2)
    parts = [
        UncertaintyPart(
            name="counting of the calibration", value=cores.n0_cps, unit="counts/s", sd=cores.from_counting_cps,
            origin="measured", share=counting,
        ),
        UncertaintyPart(
            name="cores", value=round(cores.n0_cps, 5), unit="counts/s", sd=round(cores.n0_sd_cps, 5),
            origin="measured", sd_origin="assumed" if assumed else None, share=of_cores,
        ),
    ]  # fmt: skip
    first = 1
    if prior is not None:
        first, scale = 2, both.shares[1] / sources[1].sd
        parts += [part.model_copy(update={"share": part.share * scale}) for part in prior.parts]
    for source, share in zip(sources[first:], both.shares[first:], strict=True):
        sd = source.sd * source.n0_cps
        parts.append(
            UncertaintyPart(name="cores", value=source.n0_cps, unit="counts/s", sd=sd, origin="given", share=share)
        )
    others = listing([source.name for source in sources[1:]])
    names = "n0_per_bound_water", "n0_per_density"
    values = {
        **{name: round(both.weights[0] * getattr(alone, name), 5) for name in names},
        "n0_cps": round(both.n0_cps, 5), "n0_sd_cps": round(both.sd * both.n0_cps, 5), "method": "combined",
        "note": f"{alone.note}; cores weigh {100 * both.weights[0]:.0f} %, with {others}",
        "parts": parts,
    }  # fmt: skip
    return alone.model_copy(update=values), both


def difference_sd(one: N0Source, other: N0Source) -> float:
    """Difference of two independent sources, in its standard deviations."""
    return abs(math.log(one.n0_cps / other.n0_cps)) / math.hypot(one.sd, other.sd)
