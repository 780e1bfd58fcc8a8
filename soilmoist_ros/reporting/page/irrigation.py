# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The farmer's page: zones of the field by soil moisture, water in the root zone, and what to do next."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping import SoilMap, common_rate_sd
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.budget import level_remedy, place_remedy
from soilmoist_ros.reporting.certainty import (
    CERTAIN,
    Certainty,
    absolute,
    calibration_of,
    certainty,
    class_probability,
    once_a_run,
)
from soilmoist_ros.reporting.dose import missing_mm, zones_by_dose, zones_mean
from soilmoist_ros.reporting.geometry import compass_part, field_polygon
from soilmoist_ros.reporting.one_place import at_one_place, moisture_of_all
from soilmoist_ros.reporting.page.field_dose import (
    FEW_PLACES,
    MEASURED_BELOW,
    MEASURED_LIMITS,
    FieldDose,
    NoDose,
    field_dose,
    has_level,
    remedy_text,
    root_zone,
    to_capacity,
)
from soilmoist_ros.reporting.page.frame import part_of_area, percent, ranges, thousands, volume
from soilmoist_ros.reporting.page.statistics import calibration_sd, is_usable, mean_moisture, unusable_share
from soilmoist_ros.sensing import UNKNOWN_SENSOR

Array = NDArray[np.float64]

COLOURS = ("#d8b365", "#a6d5cf", "#2166ac")
"""Colours of dry, medium and moist; readers with colour-blindness can distinguish them."""
RELATIVE = ("driest third", "middle third", "wettest third")
BY_USER = ("dry", "medium", "moist")
BY_PLANT = ("too dry", "enough water", "too wet")


@dataclass(frozen=True)
class IrrigationZone:
    """A class of the field's area.

    :param limits: its range in words, with the unit
    :param share: share of the field's area [0..1]
    :param water_mm: mean water in the root zone [mm], NaN without a calibration
    :param missing_mm: mean water missing to field capacity [mm], NaN if that is unknown; ``missing_mm_p05`` and
        ``missing_mm_p95`` are its quantiles at a place, mean over the zone. All are those of the dose
    """

    name: str
    limits: str
    colour: str
    area_m2: float
    share: float
    certainty: Certainty
    water_mm: float = math.nan
    missing_mm: float = math.nan
    missing_mm_p05: float = math.nan
    missing_mm_p95: float = math.nan

    @property
    def area(self) -> str:
        """Area of the zone, in the unit of the field."""
        return part_of_area(self.area_m2, self.area_m2 / self.share) if self.share > 0 else "0"

    @property
    def sure_area(self) -> str:
        """Area of its certain places, in words."""
        sure = self.certainty.sure
        if not sure > 0 or sure == 1:
            return "all of it" if sure == 1 else "none of it"
        return f"{part_of_area(sure * self.area_m2, self.area_m2 / self.share)} of it"

    @property
    def missing(self) -> str:
        """Water missing to field capacity with its interval; empty if that is unknown."""
        if not math.isfinite(self.missing_mm):
            return ""
        return f"{self.missing_mm:.0f} mm ({self.missing_mm_p05:.0f} to {self.missing_mm_p95:.0f} mm)"


@dataclass(frozen=True, eq=False)
class IrrigationAdvice:
    """Irrigation advice from a map: zones, certainty and steps.

    :param zones: from dry to moist
    :param number: number of the zone of each cell, NaN outside the field, shape (ny, nx)
    :param sure: whether a cell is certain of its zone, shape (ny, nx)
    :param not_dry: whether a cell is certain not to be in the first zone, shape (ny, nx)
    :param edges: limits between the zones [m^3/m^3]; ``None`` if they only compare places of this field
    :param basis: where the limits of the zones come from, as a sentence
    :param water: water in the root zone of the mean of the field, as a sentence; empty without a real calibration
    :param level: doubt about the absolute moisture, in sentences; empty without one
    :param steps: what to do, a sentence or two each, the most important first
    :param dose: dose of the field, or why there is none
    :param doses: rows of its table
    """

    zones: tuple[IrrigationZone, ...]
    number: Array
    sure: NDArray[np.bool_]
    not_dry: NDArray[np.bool_]
    edges: tuple[float, ...] | None
    basis: str
    water: str
    level: str
    steps: tuple[str, ...] = ()
    dose: FieldDose | NoDose | None = None
    doses: tuple[SimpleNamespace, ...] = ()

    @property
    def advice(self) -> str:
        """Steps of the advice, as one text."""
        return " ".join(self.steps)

    @property
    def machine(self) -> str:
        """Settings of the machine that the doses assume, as a sentence; empty without a dose."""
        if not isinstance(self.dose, FieldDose):
            return ""
        one = self.dose.settings
        wide = (
            f"a width of {one.width_m:g} m" if one.width_m else "no width of the machine, so a part of the field"
        )
        way = "the long side of the field" if one.direction_deg is None else f"{one.direction_deg:g}° from north"
        return (
            f"Taken: steps of {one.steps_mm:g} mm up to {one.max_dose_mm:g} mm, an efficiency of "
            f"{percent(one.efficiency)}, {wide}, driving along {way}."
        )

    @property
    def sure_share(self) -> float:
        """Share of the field whose zone is certain [0..1]."""
        return float(self.sure[np.isfinite(self.number)].mean())


@once_a_run
def irrigation(run: MapRun) -> IrrigationAdvice:
    """Zones, water and advice of a map; of its count rate if there is no calibration."""
    soil_map, of_moisture = run.soil_map, _of_moisture(run)
    # Minus the rate where no moisture can be used: more is moister.
    values = np.where(soil_map.grid.mask, soil_map.vwc if of_moisture else -soil_map.rate, np.nan)
    limits = _limits(run, values)
    index = np.searchsorted(limits.edges - limits.shift, np.nan_to_num(values), side="right")
    number = np.where(np.isfinite(values), index, np.nan)
    probability = _probability(run, number, limits)
    zones = tuple(_zone(run, i, limits, values, number, probability) for i in range(3))
    dry = _probability(run, np.where(np.isfinite(number), 0.0, np.nan), limits)
    edges = None if limits.names == RELATIVE else tuple(limits.edges.tolist())
    found = IrrigationAdvice(
        zones, number, probability >= CERTAIN, (number > 0) & (1 - dry >= CERTAIN), edges, limits.basis,
        _water(run), _level(run), dose=field_dose(run),
    )  # fmt: skip
    doses = tuple(dose_rows(run, found.dose)) if isinstance(found.dose, FieldDose) else ()
    return replace(found, doses=doses, steps=tuple(_steps(run, found, limits)))


class _Limits(NamedTuple):
    """Names of the zones, the two limits between them, and their origin; see :func:`class_probability`."""

    names: tuple[str, ...]
    edges: Array
    basis: str
    sds: tuple[float, ...] = ()
    shift: float = 0.0


def _of_moisture(run: MapRun) -> bool:
    """True if the zones are of the moisture, else of the count rate."""
    return run.calibrated and is_usable(run.soil_map)


def _probability(run: MapRun, number: Array, limits: _Limits) -> Array:
    """Probability of a zone in each cell; of a rate map the zones count from many to few neutrons."""
    soil_map, relative = run.soil_map, limits.names == RELATIVE
    if not _of_moisture(run):
        return class_probability(soil_map.rate, soil_map.rate_sd, 2 - number, -limits.edges[::-1], None, relative)
    of_limits = limits.edges, soil_map.curve, relative, limits.sds, limits.shift
    return class_probability(soil_map.rate, soil_map.rate_sd, number, *of_limits)


def _limits(run: MapRun, values: Array) -> _Limits:
    limits, zone, holds = run.irrigation, root_zone(run), has_level(run)
    if holds and limits.dry_below is not None and limits.moist_above is not None:
        basis = "The limits are those of the site file."
        if zone is not None and limits.stress != limits.dry_below:
            basis += (
                f" They do not decide the dose: dry is below {volume(limits.dry_below)} % here, and plants lack "
                f"water below {volume(limits.stress)} % there."
            )
        return _Limits(BY_USER, np.array([limits.dry_below, limits.moist_above]), basis)
    if zone is not None:
        basis = (
            f"Plants lack water below {volume(limits.stress)} %: there, {percent(limits.depletion)} of the water "
            f"between field capacity ({volume(limits.field_capacity)} %) and wilting point "
            f"({volume(limits.wilting_point)} %) is used up. Above field capacity the soil drains."
        ) + (f" Both are typical values of {limits.texture}, not measured." if limits.texture else "")
        of_plants, sds = zone[0].limits
        return _Limits(BY_PLANT, np.array(of_plants), basis, sds, zone[0].shift)
    edges = np.nanquantile(values, (1 / 3, 2 / 3))
    basis = "The zones only compare places of this field: each is about a third of the area, dry or wet."
    if math.isnan(limits.stress) and limits.dry_below is None:
        basis += (
            " For absolute zones, give wilting point and field capacity, or your own limits, in the site file."
        )
    elif not holds:
        needed = "a moisture that this soil can have" if absolute(run) else "a calibrated sensor"
        basis += f" The limits of the site file need {needed}."
    return _Limits(RELATIVE, edges, basis)


def _zone(
    run: MapRun, index: int, limits: _Limits, values: Array, number: Array, probability: Array
) -> IrrigationZone:
    chosen, zone, need = number == index, root_zone(run), to_capacity(run)
    share, known = _share(run, chosen), list[float]()
    if has_level(run) and chosen.any():
        shift = 0.0 if zone is None else zone[0].shift
        known = [float(values[chosen].mean() + shift) * run.irrigation.root_depth_mm]
        if need is not None:
            own = chosen[run.soil_map.grid.mask]
            known += [float(band[own].mean()) for band in (need.net_mm, need.p05_mm, need.p95_mm)]
    size_m2, text = share * float(field_polygon(run.soil_map.grid).area), _range_text(run, index, limits.edges)
    sure = certainty(probability[chosen])
    return IrrigationZone(limits.names[index], text, COLOURS[index], size_m2, share, sure, *known)


def _range_text(run: MapRun, index: int, edges: Array) -> str:
    """Range of a zone: moisture, or rates, which fall towards moist soil."""
    if _of_moisture(run):
        return ranges([volume(edge) for edge in edges.tolist()], "%")[index]
    return ranges([f"{-edge:.2f}" for edge in edges[::-1].tolist()], "counts/s")[2 - index]


def _water(run: MapRun) -> str:
    """Water in the root zone of the field with its 90 % interval."""
    if not has_level(run) or at_one_place(run):
        return ""
    depth = run.irrigation.root_depth_mm
    mean, zone = mean_moisture(run.soil_map), root_zone(run)
    if mean is None or not math.isfinite(mean.value):
        return ""
    low, middle, high, below = mean.p05, mean.value, mean.p95, "as moist as above"
    if zone is not None and zone[1]:
        away = SoilMap.QUANTILE_SD * zone[0].below_share * zone[0].below_sd
        low, high = middle - math.hypot(middle - low, away), middle + math.hypot(high - middle, away)
        low, middle, high = (max(value + zone[0].shift, 0.0) for value in (low, middle, high))
        if (by := zone[0].below_shift) != 0:
            below = f"{100 * abs(by):.1f} % by volume {'moister' if by > 0 else 'drier'} than above"
        below += f", ± {100 * zone[0].below_sd:.1f} %"
    text = (
        f"On average the upper {depth:g} mm of the soil hold {middle * depth:.0f} mm of water (90 % interval "
        f"{low * depth:.0f} to {high * depth:.0f} mm), if the soil below the reach of the sensor is {below}"
    )
    return f"{text}." if mean.common_sd > 0 else f"{text}. An error of the calibration is not included."


def _level(run: MapRun) -> str:
    """Doubt about the absolute moisture, in sentences; empty if percentages and millimetres are valid."""
    if not run.calibrated:
        return "Not calibrated: the map shows where it is drier and wetter, but not how much water there is."
    if calibration_of(run) == UNKNOWN_SENSOR:
        one, mean = moisture_of_all(run.track, run.soil_map.curve), mean_moisture(run.soil_map)
        ends = (float(one.vwc_p05), float(one.vwc_p95)) if at_one_place(run) else mean and (mean.p05, mean.p95)
        low, high = map(volume, ends) if ends else ("?", "?")
        return (
            f"Unknown sensor: the level lies between {low} and {high} % by volume, so it is nearly unknown. Trust "
            "where it is drier and wetter, not the percentages and millimetres. --sensor MODEL, or "
            "sensor_sensitivity in the site file, names the sensor."
        )
    if not absolute(run):
        return (
            "Illustrative: the calibration is a guess. Trust where it is drier and wetter, but not the "
            "percentages and millimetres."
        )
    if not is_usable(run.soil_map):
        return "The count rate does not fit the calibration: do not use the percentages and millimetres."
    if calibration_sd(run.soil_map) is None:
        return (
            "There is no standard deviation of N0: intervals and certainty leave an error of the calibration out."
        )
    return ""


def _steps(run: MapRun, found: IrrigationAdvice, limits: _Limits) -> Iterator[str]:
    """The next steps that help most. They never rest on a zone that is not certain."""
    samples = len(run.soil_map.samples)
    if calibration_of(run) == UNKNOWN_SENSOR:
        yield "Next: name the sensor (--sensor MODEL), or calibrate it with soil cores, for amounts of water."
    elif not absolute(run):
        aim = "the amounts of water can be used" if run.calibrated else "the map shows water"
        yield f"Next: take soil cores and calibrate the sensor, so that {aim}."
    elif not is_usable(run.soil_map):
        share = percent(unusable_share(run.soil_map))
        todo = (
            f"count longer or at more places; the moisture is not sure enough on {share} of the area"
            if run.simulated
            else "check N0, the bulk density and the tubes that were counted, then map again; on "
            f"{share} of the area the moisture is impossible"
        )
        yield f"Next: {todo}. Until then the map says where it is drier and wetter, not if water is needed."
    elif at_one_place(run):
        yield "Next: for a map of the surroundings, drive the sensor over the field or move it between places."
    elif samples < FEW_PLACES:
        yield f"Next: measure at more places; {samples} are too few to know how sure the map is."
    elif isinstance(found.dose, FieldDose):
        yield from _on_dose(run, found.dose)
        yield from _on_wet(found)
    elif found.edges:
        yield from _on_dry(run, found, limits)
        yield from _on_wet(found)
    elif not (found.zones[0].certainty.certain and found.zones[2].certainty.certain):
        yield (
            f"Next: {place_remedy(run)}{_where(run, ~found.sure)}; now the zone is certain on only "
            f"{percent(found.sure_share)} of the area."
        )
    else:
        yield "Next: compare the zones with what you see in the field, and measure again after rain or irrigation."


def _on_dry(run: MapRun, found: IrrigationAdvice, limits: _Limits) -> Iterator[str]:
    """Advice on the driest zone: parts to irrigate, parts to leave, and parts that are uncertain."""
    dry, as_well, soil_map = found.zones[0], "", run.soil_map

    def first(chosen: NDArray[np.bool_]) -> str:
        remedy = _remedy(run, limits, soil_map.rate[chosen], soil_map.rate_sd[chosen])
        return remedy or f"{place_remedy(run)} there first{_where(run, chosen)}"

    if dry.share > 0:
        as_well = " as well"
        if dry.certainty.certain:
            yield f"Irrigate the {dry.area} that are {dry.name} (certain on {dry.sure_area})."
            yield (
                f"Filling their root zone to field capacity takes {dry.missing}; add what your irrigation loses."
                if dry.missing
                else "With field capacity in the site file, this page shows how much water they lack."
            )
        else:
            seems = f"{dry.name.capitalize()} on {dry.area}, certain on {dry.sure_area}"
            yield f"{seems}: {first(found.number == 0)}."
    open_cells = (found.number > 0) & ~found.not_dry
    moist, unclear = _area(run, found.not_dry), _area(run, open_cells)
    if not open_cells.any() and not as_well:
        yield f"No irrigation needed now: no part of the field is {dry.name}."
    elif found.not_dry.any():
        yield f"No irrigation needed now on {'the other ' if as_well and not open_cells.any() else ''}{moist}."
    if open_cells.any() and not as_well and not found.not_dry.any():
        todo = first(open_cells)
        yield f"No part of the field seems {dry.name}, but that is certain on none of it: {todo}."
    elif open_cells.any():
        yield f"The other {unclear} may be {dry.name}{as_well}: {first(open_cells)}."


def _remedy(run: MapRun, limits: _Limits, rate: Array, rate_sd: Array) -> str:
    """Remedy for the largest error of places that are not certain to be dry; empty if that is of the counts."""
    curve, zone = run.soil_map.curve, root_zone(run)
    if curve is None:
        return ""
    common = 0.0 if (found := common_rate_sd(curve, rate)) is None else float(np.mean(found**2))
    variances = {"": float(np.mean(rate_sd**2)), level_remedy(run): common}
    if limits.sds and zone is not None:
        edge = float(curve.rate_cps(max(limits.edges[0] - limits.shift, 0.0)))
        below = zone[0].below_share * zone[0].below_sd
        slope = abs(float(curve.slope(edge)))
        variances[MEASURED_BELOW] = (below / slope) ** 2
        variances[MEASURED_LIMITS] = (math.sqrt(max(limits.sds[0] ** 2 - below**2, 0.0)) / slope) ** 2
    largest = max(variances, key=lambda name: variances[name])
    return f"first get {largest}, since this, not the counts, leaves it open" if largest else ""


def _share(run: MapRun, chosen: NDArray[np.bool_]) -> float:
    return np.count_nonzero(chosen) / np.count_nonzero(run.soil_map.grid.mask)


def _area(run: MapRun, chosen: NDArray[np.bool_]) -> str:
    """Area of cells, in the unit of the field."""
    whole_m2 = float(field_polygon(run.soil_map.grid).area)
    return part_of_area(whole_m2 * _share(run, chosen), whole_m2)


def _on_wet(found: IrrigationAdvice) -> Iterator[str]:
    """Advice on the wettest zone, which has more water than wanted."""
    wet = found.zones[2]
    if wet.certainty.certain:
        why = "more water would drain away unused" if wet.name == BY_PLANT[2] else "it needs no water"
        yield f"{wet.name.capitalize()} on {wet.area} (certain on {wet.sure_area}): {why}."
    elif wet.share > 0:
        yield f"{wet.name.capitalize()} on {wet.area}, certain on {wet.sure_area}."


def _where(run: MapRun, chosen: NDArray[np.bool_]) -> str:
    """Part of the field where cells lie, in words; empty if they are spread over the field."""
    part = compass_part(run.soil_map.grid, run.soil_map.grid.cells[chosen[run.soil_map.grid.mask]])
    return f" (mostly in the {part})" if part else ""


# The dose of the field, in words ---------------------------------------------------------------------------------


def dose_sentence(run: MapRun) -> str:
    """The dose of a run, how sure it is and what would make it surer; without a dose, what is missing."""
    found = field_dose(run)
    if isinstance(found, FieldDose):
        return next(_on_dose(run, found))
    return f"No dose: {found.missing}; {found.remedy}."


def _on_dose(run: MapRun, found: FieldDose) -> Iterator[str]:
    """The dose, how sure it is and what would make it surer; then what it rests on."""
    whole_m2 = float(field_polygon(run.soil_map.grid).area)
    share, area = f"decision sure on {percent(found.sure)} of the area", part_of_area(found.area_m2, whole_m2)
    doses = [zone.gross_mm for zone in found.irrigated]
    if not doses:
        what = f"No irrigation needed now on all {part_of_area(whole_m2, whole_m2)}"
        if any(zone.needed >= 0.5 for zone in found.zones):
            smallest = f"{found.settings.doses_mm[0]:g} mm, the smallest dose of the machine"
            what = f"No irrigation yet: what is missing is nearer to nothing than to {smallest}"
    else:
        amount = " to ".join(f"{dose:g}" for dose in sorted({min(doses), max(doses)})) + " mm"
        of = f" of {part_of_area(whole_m2, whole_m2)}" if found.area_m2 < 0.999 * whole_m2 else ""
        what = f"Irrigate {amount} on {area.rsplit(' ', 1)[0] if of else area}{of}"
        what += f" ({thousands(found.volume_m3)} m³), need sure on {percent(found.need_sure)} of that"
    before: tuple[str, ...] = ("simulated",) if run.simulated else ()
    before += () if found.certain else ("best estimate, not certain",)
    what, left = ": ".join([*before, what[0].lower() + what[1:]]), found.capped[1]
    most = f"; {found.largest_text}, about {left:.0f} mm remain missing" if left else ""
    yield f"{what[0].upper()}{what[1:]}{most}; {share}{_surer(run, found)}."
    if doses:
        settings = found.settings
        net, low, high = found.missing_mm
        loss = f", and {percent(1 - settings.efficiency)} is lost on the way" if settings.efficiency < 1 else ""
        yield (
            f"There {net:.0f} mm ({low:.0f} to {high:.0f} mm) are missing to {volume(settings.full)} % in the "
            f"upper {settings.root_depth_mm:g} mm{loss}."
        )
    yield from filter(None, (found.below, found.blurred))


def _surer(run: MapRun, found: FieldDose) -> str:
    """Best remedy for an uncertain dose, as the end of a sentence; empty without one."""
    if not found.remedies:
        return ""
    best = found.remedies[0]
    would = " would make it" if best.what == "counting" else ", could make it up to"
    return f"; {remedy_text(run, best)}{would} {percent(best.share)}"


def dose_rows(run: MapRun, found: FieldDose) -> list[SimpleNamespace]:
    """The doses from low to high in words, each with all its zones."""
    whole_m2, rows = float(field_polygon(run.soil_map.grid).area), []
    for gross, zones in zones_by_dose(found.zones).items():
        size, (net, low, high) = sum(zone.area_m2 for zone in zones), missing_mm(zones)
        rows.append(SimpleNamespace(
            dose=f"{gross:g} mm" if gross else "none", area=part_of_area(size, whole_m2),
            volume=f"{thousands(gross / 1000 * size)} m³" if gross else "–", missing=f"{net:.0f} mm",
            interval=f"{low:.0f} to {high:.0f} mm", needed=percent(zones_mean(zones, "needed")),
            sure=percent(zones_mean(zones, "sure")),
        ))  # fmt: skip
    return rows
