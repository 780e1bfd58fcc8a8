# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""JSON files of a finished run, read again. What the package reads of them is checked, in one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.functional_validators import AfterValidator

from soilmoist_ros.foundation import InputError, Mistake, read_json, read_limited
from soilmoist_ros.recording import SUMMARY
from soilmoist_ros.sensing import FIRST_STAMP_S, LAST_STAMP_S, CalibrationCurve, MoistureCurve, UniversalCurve

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

REMEDY = "restore the file, or make the run again"
CURVES: Mapping[str, type[CalibrationCurve | UniversalCurve]] = {
    "desilets": CalibrationCurve, "universal": UniversalCurve,
}  # fmt: skip
"""Calibration curves by the names in their parameters."""
Number = Annotated[float, Field(ge=-1e300, le=1e300)]
Positive = Annotated[float, Field(gt=0, le=1e300)]
Stamp = Annotated[float, Field(ge=FIRST_STAMP_S, le=LAST_STAMP_S)]


class _ResultPart(BaseModel):
    """Keys of a result that the package reads; others may hold anything."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False, defer_build=True)


class _Datum(_ResultPart):
    latitude_deg: Annotated[float, Field(ge=-90, le=90)]
    longitude_deg: Annotated[float, Field(ge=-180, le=180)]


class _Property(_ResultPart):
    name: str = ""
    label: str | None = None


class _Correction(_ResultPart):
    name: str
    parameters: dict[str, Any] | None = None


class _Calibration(_ResultPart):
    curve: str | None = None
    n0_cps: Positive | None = None
    bulk_density_gcm3: Positive | None = None
    lattice_water: Number | None = None
    organic_water: Number | None = None
    n0_sd_cps: Number | None = None
    bulk_density_sd_gcm3: Number | None = None
    bound_water_sd: Number | None = None
    n0_per_bound_water: Number | None = None
    n0_per_density: Number | None = None
    humidity_gm3: Number | None = None
    parameter_set: str | None = None


class _Irrigation(_ResultPart):
    root_depth_mm: Positive | None = None
    zone_limits_vwc: list[Number] | None = None


class _Summary(_ResultPart):
    datum: _Datum | None = None
    cell_m: Positive | None = None
    first_stamp_s: Stamp | None = None
    last_stamp_s: Stamp | None = None
    survey_start_utc: Annotated[str, AfterValidator(datetime.fromisoformat)] | None = None
    mission: dict[str, Any] | None = None
    properties: list[_Property] | None = None
    corrections: list[_Correction] | None = None
    calibration: _Calibration | None = None
    irrigation: _Irrigation | None = None


class _ResultFeature(_ResultPart):
    geometry: dict[str, Any]
    properties: dict[str, Any]


class _Features(_ResultPart):
    features: list[_ResultFeature]


def read_summary(folder: Path) -> dict[str, Any]:
    """Content of the ``summary.json`` of a run. What is there of the known keys is as a run writes it.

    :raises InputError: if the file is missing or damaged
    """
    return _read(folder / SUMMARY, _Summary)


def curve_of(about: Mapping[str, Any], path: Path) -> MoistureCurve | None:
    """Calibration curve of the first property of a run, ``None`` without one.

    :param about: its summary, see :func:`read_summary`
    :param path: folder of the run, for messages
    :raises InputError: if the curve is unknown, or a parameter is missing or out of range
    """
    calibration = about.get("calibration")
    if calibration is None:
        return None
    kind = CURVES.get(calibration.get("curve"))
    if kind is None:
        message = f"has a calibration with the curve {calibration.get('curve')!r}, not one of {', '.join(CURVES)}"
        raise InputError(message, REMEDY, path / SUMMARY)
    names = [one.name for one in fields(kind)]
    given = {name: calibration[name] for name in names if calibration.get(name) is not None}
    try:
        return kind(**given)
    except (TypeError, ValueError) as error:
        raise InputError(f"has a damaged calibration: {error}", REMEDY, path / SUMMARY) from None


def is_illustrative(about: Mapping[str, Any]) -> bool:
    """True if the calibration of a run is a guess; of older runs, if a warning says so.

    :param about: its summary, see :func:`read_summary`
    """
    told = (about.get("calibration") or {}).get("illustrative")
    return "illustrative_calibration" in (about.get("warning_codes") or ()) if told is None else bool(told)


def calibration_method(about: Mapping[str, Any]) -> str:
    """Method of the calibration of a run: ``cores``, ``general``, ``combined`` or ``unknown sensor``.

    :param about: its summary, see :func:`read_summary`
    """
    return str((about.get("calibration") or {}).get("method") or "cores")


def read_features(path: Path) -> list[dict[str, Any]]:
    """Features of a GeoJSON file of a run; each has a geometry and properties.

    :raises InputError: if the file is missing or damaged
    """
    features: list[dict[str, Any]] = _read(path, _Features)["features"]
    return features


def shape_of(feature: Mapping[str, Any], path: Path) -> BaseGeometry:
    """Geometry of a feature, in degrees.

    :param path: file that it is from, for messages
    :raises InputError: if it is none
    """
    from shapely.errors import ShapelyError
    from shapely.geometry import shape

    try:
        return shape(feature["geometry"])
    except (ShapelyError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"has a damaged geometry: {error!s:.200}", REMEDY, path) from None


def _read(path: Path, kind: type[_ResultPart]) -> dict[str, Any]:
    try:
        content = read_json(read_limited(path, "make the run again").decode("utf-8"))
        kind.model_validate(content)
    except ValidationError as error:
        found = error.errors(include_url=False)
        mistakes = [Mistake(one["msg"], REMEDY, path, 0, ".".join(map(str, one["loc"]))) for one in found[:5]]
        raise InputError(mistakes) from None
    except ValueError as error:
        raise InputError(f"cannot be read: {error}", "make the run again", path) from None
    return dict(content)
