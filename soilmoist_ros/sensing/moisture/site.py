# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The site file: corrections, soil and calibration of one sensor at one place."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from soilmoist_ros.foundation import Section, load_model, resource
from soilmoist_ros.sensing.corrections.factors import Corrections
from soilmoist_ros.sensing.corrections.settings import CorrectionSettings, HumidityCorrection, Location
from soilmoist_ros.sensing.formats.logger_format import ZoneName
from soilmoist_ros.sensing.moisture import bound_water
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve, MoistureCurve
from soilmoist_ros.sensing.moisture.universal import SIMULATED_DENSITY_GCM3, UniversalCurve

_log = logging.getLogger(__name__)
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
WaterFraction = Annotated[float, Field(ge=0, lt=1)]


class Soil(Section):
    """Soil properties that the calibration curve needs."""

    bulk_density_gcm3: Annotated[float, Field(ge=0.02, le=2.8)]
    """Dry bulk density [g/cm^3]."""
    bulk_density_sd_gcm3: NotNegative | None = None
    """Standard deviation of the bulk density [g/cm^3]."""
    lattice_water: WaterFraction = 0.0
    """Gravimetric lattice water [g/g]."""
    organic_water: WaterFraction = 0.0
    """Gravimetric water equivalent of soil organic matter [g/g]."""
    clay: WaterFraction | None = None
    """Clay content [g/g]; gives the lattice water if it is left out."""
    organic_carbon: WaterFraction | None = None
    """Organic carbon [g/g]; gives the organic water if it is left out."""

    @model_validator(mode="before")
    @classmethod
    def _bound_water(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        known = dict(values)
        for water, source, of in (
            ("lattice_water", "clay", bound_water.lattice_water),
            ("organic_water", "organic_carbon", bound_water.organic_water),
        ):
            if isinstance(known.get(source), (int, float)):
                known.setdefault(water, of(known[source]))
        return known


class Calibration(Section):
    """Result of a calibration, as ``soilmoist calibrate`` writes it."""

    n0_cps: Positive
    """Count rate over dry soil N0: all tubes, corrected [counts/s]. It belongs to its curve."""
    curve: Literal["desilets", "universal"] = "desilets"
    """Curve from the rate to the moisture: Desilets et al. (2010), or Köhli et al. (2021)."""
    parameter_set: Literal["mcnp_drf", "mcnp_thl", "uranos_drf", "uranos_thl"] = "mcnp_drf"
    """Parameters of the universal curve."""
    n0_sd_cps: NotNegative | None = None
    """Standard deviation of N0 [counts/s]."""
    date: str | None = None
    """Day of the calibration."""
    note: str | None = None
    """Method of the calibration."""
    illustrative: bool = False
    """Whether N0 is a guess, not a calibration of this probe; absolute moisture is then not real."""

    @property
    def has_origin(self) -> bool:
        """Whether the file says where N0 comes from: a day, a method or a standard deviation."""
        return bool(self.date or self.note or self.n0_sd_cps)


class Irrigation(Section):
    """Limits of dry and moist soil for the report; terciles of the field if none are given."""

    root_depth_mm: Annotated[float, Field(gt=0, le=3000)] = 300.0
    """Depth of the root zone [mm]."""
    wilting_point: WaterFraction | None = None
    """Moisture at the wilting point [m^3/m^3]."""
    field_capacity: WaterFraction | None = None
    """Moisture at field capacity [m^3/m^3]."""
    depletion: Annotated[float, Field(gt=0, lt=1)] = 0.5
    """Share of the water between both that plants use before they lack water (FAO paper 56, table 22)."""
    dry_below: WaterFraction | None = None
    """Your own limit of dry soil [m^3/m^3]; replaces those above."""
    moist_above: WaterFraction | None = None
    """Your own limit of moist soil [m^3/m^3]."""

    @model_validator(mode="after")
    def _in_pairs(self) -> Irrigation:
        for low, high in (("wilting_point", "field_capacity"), ("dry_below", "moist_above")):
            values = getattr(self, low), getattr(self, high)
            if (values[0] is None) != (values[1] is None):
                raise ValueError(f"give '{low}' and '{high}' together")
            if values[0] is not None and values[0] >= values[1]:
                raise ValueError(f"'{low}' must be below '{high}'")
        return self


class Site(Section):
    """One sensor at one site."""

    name: str = "unnamed site"
    """Name shown in reports."""
    longitude: Literal["signed", "east", "west"] = "signed"
    """Hemisphere of the site, for loggers that write longitudes without a sign."""
    logger_utc_offset_hours: Annotated[float, Field(ge=-12, le=14)] | None = None
    """Logger's clock minus UTC [h]; that of the logger format if left out."""
    time_zone: ZoneName | None = None
    """Time zone of the field by its name, such as Europe/London, for local times next to UTC in reports."""
    logger_time_zone: ZoneName | None = None
    """Instead, time zone of the logger's clock, such as Europe/Berlin, if it changes to summer time."""
    location: Location | None = None
    """Position of a probe that does not log positions (a stationary probe)."""
    footprint_radius_m: Annotated[float, Field(gt=0, le=1000)] = 10.0
    """Radius around the sensor that dominates its counts [m]; about 10 with the robot's shield."""
    deconvolve_footprint: bool | None = None
    """Whether the map shows the rate at each place, or its mean over the footprint around the place. Each place if
    left out, where the radius is given and the counts do not object."""
    vegetation_height_m: NotNegative = 0.0
    """Height of the vegetation during the calibration [m]; it shortens the footprint."""
    corrections: CorrectionSettings = CorrectionSettings()
    """Correction of the counts."""
    tube_shares: list[NotNegative] | None = None
    """Share of each tube in the rate of the whole sensor; estimated from the log if left out."""
    soil: Soil | None = None
    """Soil properties; without them only the rate is mapped."""
    calibration: Calibration | None = None
    """Calibration; without it only the rate is mapped."""
    irrigation: Irrigation = Irrigation()
    """Limits of dry and moist soil for the report."""

    def __repr_args__(self) -> Iterator[tuple[str, str]]:
        yield "name", self.name

    @model_validator(mode="after")
    def _place_is_known(self) -> Site:
        # Fails for a value that is ``auto`` without a place.
        _ = self.corrections_parameters
        return self

    @model_validator(mode="after")
    def _one_clock(self) -> Site:
        if self.logger_time_zone and self.logger_utc_offset_hours is not None:
            raise ValueError("give 'logger_time_zone' or 'logger_utc_offset_hours', not both")
        return self

    @property
    def logger_clock(self) -> float | str | None:
        """Logger's clock minus UTC [h] or its time zone; ``None`` for that of the logger format."""
        return self.logger_time_zone or self.logger_utc_offset_hours

    @property
    def corrections_parameters(self) -> Corrections:
        """Parameters for :mod:`factors`; a correction switched off is neutral."""
        parameters = self.corrections.parameters(self.location)
        if self.humidity_method == "universal":
            return replace(parameters, humidity_response=self._humidity_response)
        return parameters

    @property
    def humidity_method(self) -> Literal["linear", "universal"]:
        """How counts are corrected for humidity."""
        settings = self.corrections.humidity
        if settings is None:
            return "linear"
        by_curve = self.calibration is not None and self.calibration.curve == "universal"
        return settings.method or ("universal" if by_curve else "linear")

    @property
    def _humidity_response(self) -> Callable[[float], float]:
        unit = {"n0_cps": 1.0, "n0_sd_cps": None}  # the response is relative, and N0 may be unknown
        calibration = (self.calibration or Calibration(n0_cps=1.0)).model_copy(update=unit)
        soil = self.soil or Soil(bulk_density_gcm3=SIMULATED_DENSITY_GCM3)
        curve = _universal_curve(calibration, soil, self.reference_humidity_gm3)
        return partial(curve.humidity_response, self.corrections.typical_vwc)

    @property
    def reference_humidity_gm3(self) -> float:
        """Absolute humidity to which counts are corrected [g/m^3]."""
        return (self.corrections.humidity or HumidityCorrection()).reference_gm3

    @property
    def known_footprint_m(self) -> float:
        """Radius of the footprint if the file gives it or asks for its deconvolution [m]; 0 otherwise."""
        known = self.deconvolve_footprint or "footprint_radius_m" in self.model_fields_set
        return self.footprint_radius_m if known else 0.0

    def unused_keys(self) -> Iterator[tuple[str, str]]:
        """Keys of the file that change nothing, and why."""
        soil = self.soil
        if (
            soil is not None
            and soil.clay is not None
            and soil.lattice_water != bound_water.lattice_water(soil.clay)
        ):
            yield "soil.clay", "lattice_water is given"
        carbon = None if soil is None else soil.organic_carbon
        if soil is not None and carbon is not None and soil.organic_water != bound_water.organic_water(carbon):
            yield "soil.organic_carbon", "organic_water is given"
        intensity, humidity = self.corrections.intensity, self.corrections.humidity
        universal = self.humidity_method == "universal"
        if intensity is not None and intensity.constant is not None:
            if "gaps" in intensity.model_fields_set:
                yield "corrections.intensity.gaps", "a constant rate has none"
            if intensity.monitor is not None and intensity.scaling == "none":
                yield "corrections.intensity.monitor", "the scaling is none"
        if humidity is not None and universal and "coefficient_m3g" in humidity.model_fields_set:
            yield "corrections.humidity.coefficient_m3g", "the factor is that of the universal curve"
        if "typical_vwc" in self.corrections.model_fields_set and not universal and self.corrections.road is None:
            yield "corrections.typical_vwc", "no factor depends on the moisture"
        auto = intensity is not None and intensity.scaling != "none"
        auto |= self.corrections.pressure is not None and self.corrections.pressure.beta_per_hpa is None
        if self.corrections.cutoff_rigidity_gv is not None and not auto:
            yield "corrections.cutoff_rigidity_gv", "neither 'beta_per_hpa: auto' nor a scaling needs it"
        curve = self.calibration.curve if self.calibration is not None else "universal"
        given = self.calibration.model_fields_set if self.calibration is not None else ()
        if "parameter_set" in given and curve != "universal" and not universal:
            yield "calibration.parameter_set", f"the curve is {curve}"
        if "depletion" in self.irrigation.model_fields_set and self.irrigation.wilting_point is None:
            yield "irrigation.depletion", "wilting_point and field_capacity are not given"

    @property
    def curve(self) -> MoistureCurve | None:
        """Calibration curve, ``None`` until the site has both soil properties and N0."""
        if self.soil is None or self.calibration is None:
            return None
        return moisture_curve(self.calibration, self.soil, self.reference_humidity_gm3)


def moisture_curve(calibration: Calibration, soil: Soil, reference_humidity_gm3: float = 0.0) -> MoistureCurve:
    """The curve that a calibration names.

    :param reference_humidity_gm3: absolute humidity to which the rates are corrected [g/m^3]
    """
    if calibration.curve == "universal":
        return _universal_curve(calibration, soil, reference_humidity_gm3)
    return CalibrationCurve(*_common(calibration, soil))


def _universal_curve(calibration: Calibration, soil: Soil, humidity_gm3: float) -> UniversalCurve:
    return UniversalCurve(*_common(calibration, soil), humidity_gm3, calibration.parameter_set)


def _common(calibration: Calibration, soil: Soil) -> tuple[float, float, float, float, float, float]:
    """Parameters that all curves share, in order."""
    return (
        calibration.n0_cps,
        soil.bulk_density_gcm3,
        soil.lattice_water,
        soil.organic_water,
        calibration.n0_sd_cps or 0.0,
        soil.bulk_density_sd_gcm3 or 0.0,
    )


def load_site(name_or_path: str | Path) -> Site:
    """Read a site file; a relative path of the intensity file starts at the site file's folder.

    >>> load_site("gypsum_transect").calibration.n0_cps
    9.0

    Files of release 0.1 mark a guessed N0 by the word *illustrative* in the note of the calibration. They are read
    like files with the key ``illustrative: true``, with a warning.

    :param name_or_path: path of a site file, or name of a shipped site file
    :raises InputError: if there is no such file, or with every mistake in the file
    """
    path = resource("sites", name_or_path) if isinstance(name_or_path, str) else name_or_path
    site = _with_key_illustrative(load_model(path, Site), path)
    intensity = site.corrections.intensity
    if intensity is None or intensity.file is None or intensity.file.is_absolute():
        return site
    resolved = intensity.model_copy(update={"file": path.parent / intensity.file})
    corrections = site.corrections.model_copy(update={"intensity": resolved})
    return site.model_copy(update={"corrections": corrections})


def _with_key_illustrative(site: Site, path: Path) -> Site:
    calibration = site.calibration
    if calibration is None or "illustrative" in calibration.model_fields_set:
        return site
    if "illustrative" not in (calibration.note or ""):
        return site
    _log.warning("%s: write 'illustrative: true' below 'calibration'; the note will not be searched for it", path)
    return site.model_copy(update={"calibration": calibration.model_copy(update={"illustrative": True})})
