"""A run made of a map, its records and its site."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.foundation.version import __version__
from soilmoist_ros.mapping import SoilMap
from soilmoist_ros.reporting.run import CalibrationInfo, CorrectionRow, InputFile, LossRow, MapRun
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.records import CountRecord


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
        corrections=_correction_rows(track, site),
        losses=losses,
        calibration=_calibration(site),
        simulated=simulated,
        version=__version__,
        settings=settings,
        footprint_radius_m=site.footprint_radius_m,
        quarantined=[record for record in records if record.quarantine],
    )


def input_file(path: Path, role: str, n_records: int | None = None) -> InputFile:
    """An input file of a run, with its size and checksum."""
    content = path.read_bytes()
    return InputFile(str(path), n_records, len(content), hashlib.sha256(content).hexdigest(), role)


def _correction_rows(records: Sequence[CountRecord], site: Site) -> list[CorrectionRow]:
    settings = site.corrections
    monitor = settings.intensity
    rows = [
        (
            "air pressure",
            "exp(beta (P - P0))",
            "f_pressure",
            {"beta [1/hPa]": settings.pressure.beta_per_hpa, "P0 [hPa]": settings.pressure.reference_hpa}
            if settings.pressure
            else None,
            "",
        ),
        (
            "air humidity",
            "1 + c (Q - Q0)",
            "f_humidity",
            {"c [m3/g]": settings.humidity.coefficient_m3g, "Q0 [g/m3]": settings.humidity.reference_gm3}
            if settings.humidity
            else None,
            "",
        ),
        (
            "incoming neutrons",
            "C0 / C",
            "f_intensity",
            {"C0": monitor.reference} if monitor else None,
            f"C from {monitor.file.name if monitor.file else 'a constant'}" if monitor else "",
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
    ]


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
