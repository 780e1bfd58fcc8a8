# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A run made of a map, its records and its site."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from soilmoist_ros.foundation import InputError, LocalFrame, __version__, shown_path
from soilmoist_ros.mapping import Covariates, Skip, Snapshot, SoilMap
from soilmoist_ros.reporting.earlier.earlier_runs import EarlierRun, with_corrections
from soilmoist_ros.reporting.earlier.run_change import run_change
from soilmoist_ros.reporting.run import (
    CalibrationInfo,
    CorrectionRow,
    InputFile,
    IrrigationLimits,
    LossRow,
    MapRun,
    Note,
)
from soilmoist_ros.sensing import (
    Corrections,
    CorrectionSettings,
    CountRecord,
    Footprint,
    IntensityCorrection,
    Kind,
    NeutronMonitor,
    SensedSoil,
    Site,
    intensity_source,
    read_data,
    reason_text,
    sensed_soil,
)


def make_run(
    soil_map: SoilMap,
    records: Sequence[CountRecord],
    site: Site,
    frame: LocalFrame,
    *,
    field_name: str,
    settings: Mapping[str, object],
    title: str | None = None,
    inputs: Sequence[InputFile] = (),
    logger_format: str = "",
    losses: Sequence[LossRow] = (),
    simulated: bool = False,
    notes: Sequence[Note] = (),
    earlier: Sequence[EarlierRun] = (),
    covariates: Covariates | None = None,
) -> MapRun:
    """The run behind a map, made now.

    :param soil_map: the map
    :param records: records in order of time, at least one good one; includes records without a place, and
        quarantined ones
    :param site: site of the sensor; the records have its corrections
    :param frame: plane of the field
    :param title: title of the report; ``None`` derives it from what is mapped

    The other parameters are those of :class:`MapRun`.
    """
    track = [record for record in records if not record.quarantine]
    rows = _correction_rows(track, site)
    earlier = [with_corrections(one, {row.name: row.parameters for row in rows}) for one in earlier]
    stamp_s = max((record.stamp_s for record in track), default=0.0)
    return MapRun(
        soil_map=soil_map,
        frame=frame,
        created_utc=datetime.now(UTC),
        track=track,
        title=title or ("Soil moisture map" if site.curve else "Neutron count rate map"),
        site=site.name,
        field_name=field_name,
        inputs=inputs,
        logger_format=logger_format,
        corrections=rows,
        losses=losses,
        calibration=_calibration(site),
        simulated=simulated,
        notes=notes,
        version=__version__,
        settings=settings,
        footprint_radius_m=site.footprint_radius_m,
        quarantined=[record for record in records if record.quarantine],
        irrigation=IrrigationLimits(**site.irrigation.model_dump()),
        time_zone=site.time_zone or "",
        sensed=_sensed_soil(soil_map, track, site),
        earlier=earlier,
        change=run_change(soil_map, stamp_s, earlier),
        covariates=covariates,
    )


def input_file(path: Path, role: str, n_records: int | None = None) -> InputFile:
    """An input file of a run, with its size and checksum."""
    content = read_data(path)
    return InputFile(shown_path(path), n_records, len(content), hashlib.sha256(content).hexdigest(), role)


def _correction_rows(records: Sequence[CountRecord], site: Site) -> list[CorrectionRow]:
    settings = site.corrections
    used, intensity = site.corrections_parameters, settings.intensity
    rows = [
        (
            "air pressure",
            "exp(beta (P - P0))",
            "f_pressure",
            {"beta [1/hPa]": round(used.beta_per_hpa, 6), "P0 [hPa]": round(used.reference_pressure_hpa, 2)}
            if settings.pressure
            else None,
            _from_the_place(site) if settings.pressure else "",
        ),
        (
            "air humidity",
            "1 + c (Q - Q0)" if site.humidity_method == "linear" else "N(Q0) / N(Q), universal transport solution",
            "f_humidity",
            _humidity_parameters(site),
            "",
        ),
        (
            "incoming neutrons",
            "C0 / C" if used.intensity_scale == 1 else "1 / (1 + k (C / C0 - 1))",
            "f_intensity",
            _intensity_parameters(intensity, used) if intensity else None,
            _intensity_source(settings, records) if intensity else "",
        ),
    ]
    return [
        CorrectionRow(
            name,
            formula,
            parameters or {},
            *_range([getattr(record, factor) for record in records]),
            remark=remark if parameters else "not applied",
        )
        for name, formula, factor, parameters, remark in rows
    ] + _constant_rows(settings)


def _constant_rows(settings: CorrectionSettings) -> list[CorrectionRow]:
    """Factors of plants and road; only those of the site file."""
    rows = []
    if settings.biomass is not None:
        biomass, share = settings.biomass.used
        plants = {"B [kg/m2]": round(biomass, 3), "b [m2/kg]": round(share, 5)}
        rows.append(CorrectionRow("plants", "1 / (1 - b B)", plants, *_range([settings.f_biomass]), "constant"))
    if settings.road is not None:
        road = {
            "width [m]": settings.road.width_m,
            "distance [m]": settings.road.distance_m,
            "road [m3/m3]": settings.road.vwc,
            "field [m3/m3]": settings.typical_vwc,
        }
        rows.append(CorrectionRow("road", "1 / (1 + F1 F2 F3)", road, *_range([settings.f_road]), "constant"))
    return rows


def _sensed_soil(soil_map: SoilMap, track: Sequence[CountRecord], site: Site) -> SensedSoil | None:
    """Depth and radius that the counts of a moisture map come from, in the mean air of the survey."""
    curve, used = soil_map.curve, site.corrections_parameters
    if curve is None or not track:
        return None
    f_pressure = float(np.mean([record.f_pressure for record in track]))
    f_humidity = float(np.mean([record.f_humidity for record in track]))
    pressure_hpa = used.reference_pressure_hpa + math.log(f_pressure) / used.beta_per_hpa
    air = Footprint(
        0.0, used.humidity_gm3(f_humidity), pressure_hpa, site.vegetation_height_m, site.footprint_radius_m
    )
    vwc = soil_map.vwc[soil_map.grid.mask]
    return sensed_soil(vwc, curve.bulk_density_gcm3, curve.lattice_water + curve.organic_water, air)


def _from_the_place(site: Site) -> str:
    """Values of the pressure correction that follow from the place; empty if there are none."""
    pressure, cosmic = site.corrections.pressure, site.corrections.cosmic(site.location)
    if pressure is None or cosmic is None or None not in (pressure.beta_per_hpa, pressure.reference_hpa):
        return ""
    names = ["beta"] * (pressure.beta_per_hpa is None) + ["P0"] * (pressure.reference_hpa is None)
    return (
        f"{' and '.join(names)} from the place ({cosmic.cutoff_rigidity_gv:.2f} GV, {cosmic.depth_gcm2:.0f} g/cm2)"
    )


def _intensity_parameters(intensity: IntensityCorrection, used: Corrections) -> dict[str, float | str]:
    scaled = {} if intensity.scaling == "none" else {"k": round(used.intensity_scale, 4)}
    return {"C0": intensity.reference, **scaled}


def _intensity_source(settings: CorrectionSettings, records: Sequence[CountRecord]) -> str:
    intensity = settings.intensity
    assert intensity is not None
    monitor = f" of {intensity.monitor.name}" if intensity.monitor else ""
    scaling = "" if intensity.scaling == "none" else f", scaled as in {intensity.scaling}"
    text = f"C{monitor} from {intensity.file.name if intensity.file else 'a constant'}{scaling}"
    try:
        series = intensity_source(settings)
    except InputError:  # the file of a recorded run may be elsewhere
        return text
    if not isinstance(series, NeutronMonitor):
        return text
    if not monitor and series.station:
        text = text.replace("C from", f"C of {series.station} from", 1)
    gap_s = series.longest_gap_s(records[0].stamp_s, records[-1].stamp_s)
    filled = "held" if intensity.gaps == "hold" else "interpolated"
    return f"{text}; gaps up to {gap_s / 3600:.1f} h {filled}" if gap_s > 0 else text


def _humidity_parameters(site: Site) -> dict[str, float | str] | None:
    settings = site.corrections.humidity
    if settings is None:
        return None
    reference: dict[str, float | str] = {"Q0 [g/m3]": settings.reference_gm3}
    if site.humidity_method == "universal":
        return {**reference, "at moisture [m3/m3]": site.corrections.typical_vwc}
    return {"c [m3/g]": settings.coefficient_m3g, **reference}


def _range(factors: Sequence[float]) -> tuple[float, float, float]:
    return float(np.mean(factors)), min(factors), max(factors)


def _calibration(site: Site) -> CalibrationInfo | None:
    if site.calibration is None or site.soil is None:
        return None
    source = ", ".join(filter(None, [site.calibration.date, site.calibration.note]))
    return CalibrationInfo(
        n0_cps=site.calibration.n0_cps,
        bulk_density_gcm3=site.soil.bulk_density_gcm3,
        n0_sd_cps=site.calibration.n0_sd_cps,
        lattice_water=site.soil.lattice_water,
        organic_water=site.soil.organic_water,
        source=source,
        illustrative=site.calibration.illustrative,
    )


def loss_rows_of(snapshot: Snapshot) -> list[LossRow]:
    """What a map has left out: a row for each reason, lost records first, then those that others quarantined."""
    last = {
        record.quarantine: record
        for record in snapshot.track
        if record.quarantine not in ("", Kind.UNEXPECTED_COUNT)
    }
    counts = Counter(record.quarantine for record in snapshot.track)
    return [
        *(
            LossRow(
                reason.value,
                entry.count,
                entry.example,
                "quarantined" if reason is Skip.UNEXPECTED else "lost",
                reason.remedy,
            )
            for reason, entry in snapshot.skipped.items()
            if reason is not Skip.QUARANTINED
        ),
        *(
            LossRow(reason_text(reason), counts[reason], str(record), "quarantined", Skip.QUARANTINED.remedy)
            for reason, record in last.items()
        ),
    ]
