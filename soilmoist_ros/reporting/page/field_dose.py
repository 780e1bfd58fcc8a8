# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Irrigation dose of a run: whether it has one, the soil below the sensed depth, and what would make it surer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import SoilMap, common_rate_sd
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.budget import level_remedy
from soilmoist_ros.reporting.certainty import ILLUSTRATIVE, absolute, calibration_of, once_a_run
from soilmoist_ros.reporting.dose import (
    Dose,
    DosePlan,
    DoseSettings,
    DoseZone,
    find_dose,
    sure_share,
    zones_of_dose,
)
from soilmoist_ros.reporting.geometry import compass_part, field_polygon
from soilmoist_ros.reporting.one_place import at_one_place
from soilmoist_ros.reporting.page.frame import percent
from soilmoist_ros.reporting.page.statistics import is_usable
from soilmoist_ros.sensing import UNKNOWN_SENSOR, Irrigation, MoistureCurve

Array = NDArray[np.float64]

FEW_PLACES = 10
USEFUL_SHARE = 0.5
"""Share of the area where the decision to irrigate or not must be certain for a dose, whatever the calibration."""
MEASURED_LIMITS = "measured field capacity and wilting point"
MEASURED_BELOW = "a measurement of the soil below the sensed depth"
BELOW_SD_SHARE = 0.25
"""Standard deviation of the moisture below the sensed depth about that above, as a share of the available water:
an assumption, no measurement."""
FILTER_DAYS = (20.0, 5.0, 40.0)
"""Characteristic time of the exponential filter, and its range [d] (Wagner et al. 1999, Remote Sens. Environ.
70:191, for the upper metre; Albergel et al. 2008, HESS 12:1323, find no relation to the soil)."""
DEFAULT_DEPTH_MM = 200.0
"""Sensed depth where it is not known [mm]."""
MINUTES = (3, 6, 12, 20, 30, 45, 60, 90, 120, 180)
"""Times of more counting that are tried [min]."""
MIN_GAIN = 0.05
"""Share of the field that more counting must make certain to be worth a sentence."""
_CELLS, _STOPS = 150, 4
_CAPACITY = {"target": None, "target_share": 1.0}
_Z = 0.8416212335729143
"""Quantile :data:`CERTAIN` of the standard normal distribution."""


class Remedy(NamedTuple):
    """Remedy that makes the need of more places certain.

    :param what: ``counting``, ``calibration``, ``limits`` or ``below``
    :param share: share of the area that is then expected to be certain [0..1]
    :param minutes: time of counting [min]; 0 for the others
    :param part: part of the field where to count, such as "south"; empty if all over the field
    """

    what: str
    share: float
    minutes: int = 0
    part: str = ""


@dataclass(frozen=True, eq=False)
class FieldDose(DosePlan):
    """Dose of a field.

    :param dose: of each cell of the map, in the order of ``grid.cells``
    :param below: what is taken of the soil below the sensed depth, as a sentence; empty if the sensor sees it all
    :param remedies: what would make the need of more places certain, the best first
    """

    dose: Dose
    below: str
    remedies: Sequence[Remedy]

    @property
    def content(self) -> dict[str, Any]:
        """Figures for ``summary.json``."""
        figures = [field.name for field in fields(DoseZone)[1:]]
        columns = [*figures, "area_m2", "volume_m3", "rings_m"]
        return {
            "missing": None, "settings": self.settings.model_dump(), "target_vwc": self.settings.full,
            "needed_below_vwc": self.settings.stress, "area_m2": self.area_m2, "volume_m3": self.volume_m3,
            "sure_share": self.sure, "need_sure_share": self.need_sure,
            "certain": self.certain, "blurred": self.blurred, "below": self.below,
            "remedies": [one._asdict() for one in self.remedies],
            "zones": [{name: getattr(zone, name) for name in columns} for zone in self.zones],
        }  # fmt: skip


class NoDose(NamedTuple):
    """Reason for the lack of a dose, and its remedy."""

    missing: str
    remedy: str

    @property
    def content(self) -> dict[str, Any]:
        """Figures for ``summary.json``."""
        return {**self._asdict(), "settings": None}


def has_level(run: MapRun) -> bool:
    """True if limits, amounts of water and advice may rest on the moisture of a map."""
    return absolute(run) and is_usable(run.soil_map)


@once_a_run
def root_zone(run: MapRun) -> tuple[DoseSettings, str] | None:
    """Limits of the root zone with the soil below the sensed depth, and what is taken of that in words; ``None``
    without a level, or without wilting point and field capacity.
    """
    curve = run.soil_map.curve
    if curve is None or not has_level(run) or run.irrigation.wilting_point is None:
        return None
    depth_mm = None if run.sensed is None else 10 * run.sensed.depth_cm[0]
    below, text = below_sensed(depth_mm, run.irrigation, *_surveys(run, curve))
    return DoseSettings(**run.irrigation.model_dump(), **below), text


@once_a_run
def to_capacity(run: MapRun) -> Dose | None:
    """Water that each cell lacks to field capacity; ``None`` without :func:`root_zone`, or without such pores."""
    found = root_zone(run)
    try:
        return None if found is None else _need(run, found[0].model_copy(update=_CAPACITY))
    except InputError:
        return None


def _need(run: MapRun, settings: DoseSettings) -> Dose:
    soil_map, mask = run.soil_map, run.soil_map.grid.mask
    assert soil_map.curve is not None
    return find_dose(soil_map.rate[mask], soil_map.rate_sd[mask], soil_map.curve, settings)


@once_a_run
def field_dose(run: MapRun) -> FieldDose | NoDose:
    """Dose of a run, or why there is none."""
    soil_map, lacking, zone = run.soil_map, _lacking(run), root_zone(run)
    if lacking is not None or zone is None:
        return lacking or NoDose("the sensor is not calibrated", "calibrate it with soil cores")
    settings, text = zone
    try:
        known = to_capacity(run) if settings == settings.model_copy(update=_CAPACITY) else None
        dose, area = known or _need(run, settings), field_polygon(soil_map.grid)
        zones = zones_of_dose(dose, soil_map.grid.cells, soil_map.grid.cell_m, area, settings)
    except InputError as error:
        mistake = error.mistakes[0]
        return NoDose(mistake.message, mistake.remedy)
    sure, found = sure_share(dose), remedies(run, settings, dose)
    remedy = f"get {remedy_text(run, found[0])}" if found else f"get {level_remedy(run)}"
    if sure < USEFUL_SHARE:
        return NoDose(f"whether to irrigate is certain on only {percent(sure)} of the area", remedy)
    return FieldDose(settings, zones, sure, run.blurred, dose, text, found)


def remedy_text(run: MapRun, one: Remedy) -> str:
    """Measurement that makes the decision certain on more of the area."""
    if one.what == "counting":
        return f"{one.minutes} more minutes of counting{f' in the {one.part}' if one.part else ''}"
    others = {"calibration": level_remedy(run), "limits": MEASURED_LIMITS, "below": MEASURED_BELOW}
    return f"{others[one.what]}, not more counting"


def _lacking(run: MapRun) -> NoDose | None:
    """The first thing that a run lacks for a dose, with its remedy; ``None`` if it has all."""
    curve, places = run.soil_map.curve, 1 if at_one_place(run) else len(run.soil_map.samples)
    origin, limits = calibration_of(run), run.irrigation
    cores = "calibrate it with soil cores"
    if curve is None:
        return NoDose("the sensor is not calibrated", cores)
    if origin == UNKNOWN_SENSOR:
        what = "the sensor is unknown, and with it the level of the moisture"
        return NoDose(what, "name the sensor with --sensor MODEL, or calibrate it with soil cores")
    if origin == ILLUSTRATIVE:
        return NoDose("the calibration is a guess", cores)
    if not curve.n0_sd_cps > 0:
        return NoDose("the calibration states no ±", "give n0_sd_cps in the site file, or run soilmoist calibrate")
    if not is_usable(run.soil_map):
        return NoDose("the moisture is impossible on much of the area", "check N0, bulk density and tubes")
    if places == 1:
        return NoDose("all records are of one place", "drive the sensor over the field")
    if places < FEW_PLACES:
        return NoDose(f"there are fewer than {FEW_PLACES} places", "measure at more places")
    if limits.wilting_point is None or limits.field_capacity is None:
        what = "texture, or wilting_point and field_capacity, are not in the site file"
        return NoDose(what, "give irrigation: {texture: CLASS} with the class of the soil, such as loam")
    return None


# The soil below the sensed depth ---------------------------------------------------------------------------------


def soil_water_index(days: Array, vwc: Array, time_days: float) -> tuple[float, float]:
    """Moisture of the soil below from that above at several times, by a recursive exponential filter (Albergel et
    al. 2008), and its last gain: 1 if the earlier times are long ago.

    :param days: rising times [d], and the moisture above then [m^3/m^3], shape (n,) each
    :param time_days: characteristic time T [d]
    """
    index, gain = float(vwc[0]), 1.0
    for step, value in zip(np.diff(days).tolist(), vwc[1:].tolist(), strict=True):
        gain = gain / (gain + math.exp(-step / time_days))
        index += gain * (value - index)
    return index, gain


def below_sensed(
    depth_mm: float | None, limits: Irrigation, days: Array, vwc: Array
) -> tuple[dict[str, Any], str]:
    """Share, shift and standard deviation of the soil below the sensed depth, and a sentence about it.

    :param depth_mm: sensed depth [mm], ``None`` if it is not known
    :param days: rising times of the surveys [d], and the moisture of the field then [m^3/m^3], shape (n,) each
    """
    depth_mm, root_mm = depth_mm or DEFAULT_DEPTH_MM, limits.root_depth_mm
    share = max(1 - depth_mm / root_mm, 0.0)
    if share == 0:
        return {}, ""
    sd = BELOW_SD_SHARE * ((limits.field_capacity or 0.0) - (limits.wilting_point or 0.0))
    found = f"The counts come from the upper {depth_mm:.0f} mm, the roots reach {root_mm:.0f} mm."
    if len(days) < 2:
        text = f"{found} The soil below is taken to be as moist, ± {100 * sd:.1f} % by volume: an assumption."
        return {"below_share": share, "below_shift": 0.0, "below_sd": sd}, text
    (index, gain), *ends = (soil_water_index(days, vwc, time) for time in FILTER_DAYS)
    sd = math.hypot(sd * max(math.sqrt(gain), 0.5), (ends[0][0] - ends[1][0]) / 2)
    shift = index - float(vwc[-1])
    text = (
        f"{found} From {len(days) - 1} earlier survey{'s' if len(days) > 2 else ''} the soil below is taken to be "
        f"{100 * abs(shift):.1f} % by volume {'moister' if shift > 0 else 'drier'} than above, ± {100 * sd:.1f} % "
        f"(exponential filter of {FILTER_DAYS[0]:.0f} days)."
    )
    return {"below_share": share, "below_shift": shift, "below_sd": sd}, text


def _surveys(run: MapRun, curve: MoistureCurve) -> tuple[Array, Array]:
    """Days of the earlier surveys and this one, rising, and the moisture of the field's mean rate at each."""
    now = run.survey_end_utc
    if now is None:
        return np.empty(0), np.empty(0)
    mean = float(run.soil_map.rate[run.soil_map.grid.mask].mean())
    rates = {now.timestamp(): mean}
    for one in run.earlier:
        known, samples = run.change and run.change.means.get(one.survey.name), one.survey.samples
        rate = mean - known.value if known else float(samples.counts.sum() / samples.exposure_s.sum())
        if one.date and one.survey.stamp_s < now.timestamp():
            rates[one.survey.stamp_s] = rate
    vwc = np.asarray(curve.vwc(np.array([rates[stamp] for stamp in sorted(rates)])), float)
    known_vwc = np.isfinite(vwc)
    return np.array(sorted(rates))[known_vwc] / 86400, vwc[known_vwc]


# What would make it surer ----------------------------------------------------------------------------------------


def remedies(run: MapRun, settings: DoseSettings, dose: Dose) -> list[Remedy]:
    """Remedies that make the need of at least :data:`MIN_GAIN` more of the area certain, the best first. Counting
    is the best unless another one could gain twice as much.

    The expected share after more counts is that of the variance that kriging would then have, averaged over what
    the counts may show. Errors are taken as normal in the rate at the limit where plants lack water.
    """
    soil_map, now = run.soil_map, sure_share(dose)
    curve = soil_map.curve
    if curve is None or now >= 1 - MIN_GAIN:
        return []
    mask = soil_map.grid.mask
    pick = np.unique(np.linspace(0, len(dose.needed) - 1, min(_CELLS, len(dose.needed))).astype(int))
    rate, variance = soil_map.rate[mask][pick], soil_map.variance[mask][pick]
    problem = _Decision(rate, variance, curve, settings)
    found = [Remedy(what, now + problem.gain(leave_out=what)) for what in ("calibration", "limits", "below")]
    counting = _counting(run, soil_map, problem, soil_map.grid.cells[pick], now)
    if counting is not None:
        found.append(counting)
    found.sort(key=lambda one: (one.share - now) * (2 if one.what == "counting" else 1), reverse=True)
    return [one for one in found if one.share >= now + MIN_GAIN]


@dataclass(frozen=True, eq=False)
class _Decision:
    """Decision if places lack water: normal rates compared with a limit; shape (n,) each."""

    rate: Array
    variance: Array
    curve: MoistureCurve
    settings: DoseSettings

    def sure(self, variance: Array, leave_out: str = "") -> Array:
        """Probability that a place will be certain when its kriging variance has fallen to another one, any shape
        that ends with n.
        """
        from scipy.special import ndtr

        settings, curve = self.settings, self.curve
        edge = np.asarray(curve.rate_cps(max(settings.stress - settings.shift, 0.0)))
        common = None if leave_out == "calibration" else common_rate_sd(curve, self.rate)
        exact = {"limits": {"wilting_point_sd": 0.0, "field_capacity_sd": 0.0}, "below": {"below_sd": 0.0}}
        of_limit = settings.model_copy(update=exact.get(leave_out)).stress_sd / abs(float(curve.slope(edge)))
        sd = np.sqrt(variance + of_limit**2 + (0.0 if common is None else common) ** 2)
        learned = np.sqrt(np.maximum(self.variance - variance, 1e-9 * self.variance))
        away = self.rate - edge
        return np.asarray(ndtr((away - _Z * sd) / learned) + ndtr((-away - _Z * sd) / learned))

    def gain(self, variance: Array | None = None, leave_out: str = "") -> float:
        """Share of the places that becomes certain."""
        return float(self.sure(self.variance if variance is None else variance, leave_out).mean()) - self.now

    @cached_property
    def now(self) -> float:
        """Share of the places that is certain with what is known."""
        return float(self.sure(self.variance).mean())


def _counting(run: MapRun, soil_map: SoilMap, problem: _Decision, xy: Array, now: float) -> Remedy | None:
    """The shortest counting that gains at least half of what the longest would; ``None`` if that is too little."""
    between = soil_map.kriging.covariance(xy)
    nugget = soil_map.variogram.nugget
    live_s, exposure_s = sum(record.exposure_s for record in run.track), float(soil_map.samples.exposure_s.sum())
    used = min(exposure_s / live_s, 1.0) if live_s > 0 else 1.0

    chosen, left = list[int](), between
    noise = nugget + problem.rate / (used * 60 * MINUTES[-1] / _STOPS)
    for _ in range(_STOPS):  # the best stops one after the other
        own = np.diag(left)
        lower = problem.variance - np.diag(between) + own - left**2 / (own + noise)[:, None]
        chosen.append(int(np.argmax(problem.sure(np.maximum(lower, 0.0)).mean(axis=1))))
        row = left[chosen[-1]]
        left = left - np.outer(row, row) / (row[chosen[-1]] + noise[chosen[-1]])
    gains = {}
    for minutes in MINUTES:
        stops = chosen[: max(minutes // MINUTES[0], 1)]
        noise = nugget + problem.rate[stops] * len(stops) / (used * 60 * minutes)
        known = between[np.ix_(stops, stops)] + np.diag(noise)
        lower = np.einsum("ij,ij->j", between[stops], np.linalg.solve(known, between[stops]))
        gains[minutes] = problem.gain(np.maximum(problem.variance - lower, 0.0))
    best = max(gains.values())
    for minutes, gain in gains.items():
        if gain >= max(best / 2, MIN_GAIN):
            stops = chosen[: max(minutes // MINUTES[0], 1)]
            return Remedy("counting", now + gain, minutes, compass_part(soil_map.grid, xy[stops]))
    return None
