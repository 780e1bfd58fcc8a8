# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The site file of one sensor at one place (corrections, soil, calibration), and N0 from soil cores."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationInfo, field_validator, model_validator
from ruamel.yaml import YAML

from soilmoist_ros.foundation import InputError, Section, load_model, read_yaml, resource
from soilmoist_ros.sensing.corrections.factors import Corrections
from soilmoist_ros.sensing.corrections.settings import CorrectionSettings, HumidityCorrection, Location
from soilmoist_ros.sensing.formats.logger_format import ZoneName
from soilmoist_ros.sensing.moisture.curve import (
    LATTICE_WATER_OF_CLAY,
    SIMULATED_DENSITY_GCM3,
    CalibrationCurve,
    MoistureCurve,
    UniversalCurve,
    lattice_water,
    organic_water,
    soil_limits,
)
from soilmoist_ros.sensing.moisture.texture import TEXTURES, TextureName

_log = logging.getLogger(__name__)
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
WaterFraction = Annotated[float, Field(ge=0, lt=1)]
SensorModel = Literal["CRS-1000", "CRS-1000B", "CRS-2000", "CRS-2000B", "LiFoil-2", "LiFoil-3"]
"""Sensor models whose sensitivity is published."""
Crop = Literal[
    "bare", "grass", "alfalfa", "wheat", "barley", "rapeseed", "maize", "soybean", "sugar beet", "potato"
]
Stage = Literal["emerged", "growing", "full"]
UNKNOWN_SENSOR: Literal["unknown sensor"] = "unknown sensor"
"""Method of a calibration whose N0 is only possible, see ``unknown_sensor``; and name of its uncertainty."""
USUAL_N0_CPS = (0.05, 30.0)
"""N0 of sensors from one small tube at sea level to twelve large ones in the mountains [counts/s]."""
USUAL_CARBON, USUAL_CARBON_SD = 0.015, 0.007
"""Organic carbon of top soils of cropland, and its standard deviation [g/g]: a default range."""
LATTICE_WATER_SD = 0.01
"""Standard deviation of the lattice water of soils of equal clay [g/g]."""
MIN_EFFICIENCY = 0.3
"""Lowest efficiency of an irrigation that is no mistake."""
SHALLOW_ROOTS_MM = 150.0
"""Depth of roots of few crops, seedlings left aside, below which another unit is likely [mm]."""
_LENGTHS = {"m": 1000.0, "cm": 10.0, "inches": 25.4}
_FRACTION = (0.01, 1.0, {"per cent": 0.01})
_USUAL: dict[str, tuple[float, float, dict[str, float]]] = {
    "root_depth_mm": (50.0, 3000.0, _LENGTHS), "steps_mm": (0.5, 100.0, _LENGTHS),
    "min_dose_mm": (0.5, 500.0, _LENGTHS), "max_dose_mm": (2.0, 500.0, _LENGTHS),
    "width_m": (0.3, 2000.0, {"cm": 0.01, "mm": 0.001}), "min_zone_ha": (1e-4, 100.0, {"m2": 1e-4}),
    **dict.fromkeys(("wilting_point", "field_capacity", "dry_below", "moist_above", "target"), _FRACTION),
    **dict.fromkeys(("depletion", "target_share"), _FRACTION),
    **dict.fromkeys(("wilting_point_sd", "field_capacity_sd"), (0.0, 0.2, {"per cent": 0.01})),
}  # fmt: skip
"""Least and largest usual values of irrigation keys, and what other units are in theirs."""
_LIMITS_OF_SOIL = {"texture", "wilting_point", "field_capacity", "dry_below", "moist_above"}
OTHER_TIMES = {"hour": 3600.0, "minute": 60.0, "10 s": 10.0}  # times per which other programs give N0 [s]


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
    bound_water_sd: NotNegative | None = None
    """Standard deviation of lattice and organic water together [g/g]."""
    clay: WaterFraction | None = None
    """Clay content [g/g]; gives the lattice water if it is left out."""
    organic_carbon: WaterFraction | None = None
    """Organic carbon [g/g]; gives the organic water if it is left out."""
    texture: TextureName | None = None
    """USDA texture class, such as sandy loam; gives the default ranges of density and bound water left out."""

    @model_validator(mode="before")
    @classmethod
    def _bound_water(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        known = dict(values)
        texture = known.get("texture", "")
        found = next((one for name, one in TEXTURES.items() if name == texture), None)
        if found is None and texture:
            known.setdefault("bulk_density_gcm3", 1.0)  # the texture is the mistake, not the density
        if found:
            known.setdefault("bulk_density_gcm3", found.bulk_density_gcm3)
            if known["bulk_density_gcm3"] == found.bulk_density_gcm3:
                known.setdefault("bulk_density_sd_gcm3", round(found.bulk_density_sd_gcm3, 3))
            if not {"lattice_water", "organic_water", "clay", "organic_carbon"} & set(known):
                known["lattice_water"] = round(lattice_water(found.clay), 4)
                known["organic_water"] = round(organic_water(USUAL_CARBON), 4)
                sds = LATTICE_WATER_OF_CLAY * found.clay_sd, organic_water(USUAL_CARBON_SD), LATTICE_WATER_SD
                known.setdefault("bound_water_sd", round(math.hypot(*sds), 4))
        if isinstance(clay := known.get("clay"), (int, float)):
            known.setdefault("lattice_water", lattice_water(clay))
        if isinstance(carbon := known.get("organic_carbon"), (int, float)):
            known.setdefault("organic_water", organic_water(carbon))
        return known


class UncertaintyPart(Section):
    """One part of the uncertainty of a calibration."""

    name: Literal[
        "general N0", "sensitivity", "site scaling", "intensity", "pressure", "humidity", "biomass", "road",
        "snow", "bulk density", "lattice and organic water", "cores", "counting of the calibration",
        "unknown sensor",
    ]  # fmt: skip
    """What is uncertain."""
    value: Annotated[float, Field(allow_inf_nan=True)] = math.nan
    """Value that the calibration uses; NaN for what it leaves out."""
    unit: str
    """Unit of the value and of its standard deviation."""
    sd: Annotated[float, Field(ge=0)]
    """Standard deviation of the value."""
    origin: Literal["measured", "given", "default range", "literature"]
    """Where the value is from."""
    sd_origin: Literal["given", "literature", "assumed"] | None = None
    """Where its standard deviation is from, if not from there too."""
    share: Annotated[float, Field(allow_inf_nan=True)] = math.nan
    """Relative standard deviation of N0 that has the effect of this part; NaN for what acts by the curve."""

    @property
    def source(self) -> str:
        """Where value and standard deviation are from, in words."""
        return f"{self.origin}, ± {self.sd_origin}" if self.sd_origin else self.origin

    @property
    def text(self) -> str:
        """Value, if there is one, standard deviation and sources."""
        value = "" if math.isnan(self.value) else f"{self.value:.4g} "
        return f"{value}{self.unit} +- {self.sd:.2g}, {self.source}"


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
    """True if N0 is a guess, not a calibration of this probe; absolute moisture is then not real."""
    method: Literal["cores", "general", "combined", "unknown sensor"] = "cores"
    """Where N0 comes from: soil cores, the general calibration, or both combined; of an unknown sensor it is only
    possible."""
    reference_hpa: Positive | None = None
    """Air pressure to which the counts were corrected that N0 was found with [hPa]."""
    n0_per_bound_water: float = 0.0
    """Change of log N0 with the bound water that it was found with from cores [1/(g/g)]: the errors cancel."""
    n0_per_density: float = 0.0
    """Change of log N0 with the bulk density [1/(g/cm^3)]."""
    parts: list[UncertaintyPart] = Field(default_factory=list)
    """Parts of the uncertainty of N0 and soil, where they are known."""

    @property
    def has_origin(self) -> bool:
        """True if the file says where N0 comes from: a day, a method or a standard deviation."""
        return bool(self.date or self.note or self.n0_sd_cps)

    def curve_of(self, soil: Soil, reference_humidity_gm3: float = 0.0) -> MoistureCurve:
        """Curve from the rate to the moisture of a soil; the humidity is that to which rates are corrected
        [g/m^3].
        """
        values = {
            "n0_cps": self.n0_cps, "bulk_density_gcm3": soil.bulk_density_gcm3,
            "lattice_water": soil.lattice_water, "organic_water": soil.organic_water,
            "n0_sd_cps": self.n0_sd_cps or 0.0, "bulk_density_sd_gcm3": soil.bulk_density_sd_gcm3 or 0.0,
            "bound_water_sd": soil.bound_water_sd or 0.0, "n0_per_bound_water": self.n0_per_bound_water,
            "n0_per_density": self.n0_per_density,
        }  # fmt: skip
        if self.curve == "desilets":
            return CalibrationCurve(**values)
        return UniversalCurve(**values, humidity_gm3=reference_humidity_gm3, parameter_set=self.parameter_set)


class Vegetation(Section):
    """Crop on the field, for the default range of its biomass in a general calibration."""

    crop: Crop
    """Crop: bare, grass, alfalfa, wheat, barley, rapeseed, maize, soybean, sugar beet or potato."""
    stage: Stage = "full"
    """Stage of its growth: emerged, growing or full."""


class Irrigation(Section):
    """Limits of dry and moist soil for the report, terciles of the field if none are given; and the dose."""

    root_depth_mm: Annotated[float, Field(gt=0, le=3000)] = 300.0
    """Depth of the root zone [mm]."""
    wilting_point: WaterFraction | None = None
    """Moisture at the wilting point [m^3/m^3]."""
    field_capacity: WaterFraction | None = None
    """Moisture at field capacity [m^3/m^3]."""
    texture: TextureName | None = None
    """Texture class of the soil (USDA); gives wilting point and field capacity if they are left out."""
    wilting_point_sd: Annotated[float, Field(ge=0, le=0.2)] | None = None
    """Standard deviation of the wilting point [m^3/m^3]; if left out 0, or that of the texture."""
    field_capacity_sd: Annotated[float, Field(ge=0, le=0.2)] | None = None
    """Standard deviation of the field capacity [m^3/m^3], as for the wilting point."""
    depletion: Annotated[float, Field(gt=0, lt=1)] = 0.5
    """Share of the water between both that plants use before they lack water (FAO paper 56, table 22)."""
    dry_below: WaterFraction | None = None
    """Your own limit of dry soil [m^3/m^3]; replaces those above."""
    moist_above: WaterFraction | None = None
    """Your own limit of moist soil [m^3/m^3]."""
    target: WaterFraction | None = None
    """Moisture to fill the root zone to [m^3/m^3]; by ``target_share`` if left out."""
    target_share: Annotated[float, Field(gt=0, le=1)] = 1.0
    """Instead, share of the water between wilting point and field capacity to fill the root zone to."""
    efficiency: Annotated[float, Field(gt=0, le=1)] = 1.0
    """Share of the applied water that reaches the root zone."""
    steps_mm: Annotated[float, Field(gt=0, le=500)] = 5.0
    """Distance of the doses that the machine can apply [mm]."""
    min_dose_mm: Annotated[float, Field(ge=0, le=500)] = 0.0
    """Smallest dose that the machine can apply [mm]."""
    max_dose_mm: Annotated[float, Field(gt=0, le=500)] = 60.0
    """Largest dose at a time [mm]."""
    width_m: Annotated[float, Field(gt=0, le=2000)] | None = None
    """Width of the machine [m]; a part of the field if left out."""
    direction_deg: Annotated[float, Field(ge=0, le=360)] | None = None
    """Driving direction of the machine, clockwise from north [deg]; the long side of the field if left out."""
    min_zone_ha: Annotated[float, Field(gt=0)] | None = None
    """Smallest zone of one dose [ha]; 5 % of the field if left out."""

    @model_validator(mode="before")
    @classmethod
    def _of_texture(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        found = next((one for name, one in TEXTURES.items() if name == values.get("texture")), None)
        if found is None or "wilting_point" in values or "field_capacity" in values:
            return values
        names = "wilting_point", "field_capacity", "wilting_point_sd", "field_capacity_sd"
        return {**{name: getattr(found, name) for name in names}, **values}

    @field_validator("*", mode="before")
    @classmethod
    def _usual(cls, value: Any, about: ValidationInfo) -> Any:
        low, high, units = _USUAL.get(about.field_name or "", (-math.inf, math.inf, {}))
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not value > 0 or low <= value <= high:
            return value
        meant = [f"{value * by:g} if it is in {unit}" for unit, by in units.items() if low <= value * by <= high]
        if not meant:
            return value
        raise ValueError(f"{value:g} is not usual ({low:g} to {high:g}): write {' or '.join(meant)}")

    @model_validator(mode="after")
    def _in_pairs(self) -> Irrigation:
        for low, high in (("wilting_point", "field_capacity"), ("dry_below", "moist_above")):
            values = getattr(self, low), getattr(self, high)
            if (values[0] is None) != (values[1] is None):
                raise ValueError(f"give '{low}' and '{high}' together")
            if values[0] is not None and values[0] >= values[1]:
                raise ValueError(f"'{low}' must be below '{high}'")
        return self

    @model_validator(mode="after")
    def _possible_dose(self) -> Irrigation:
        typical = None if self.texture is None else TEXTURES[self.texture]
        given = self.wilting_point, self.field_capacity
        if typical is not None and given != (typical.wilting_point, typical.field_capacity):
            raise ValueError("give 'texture', or 'wilting_point' and 'field_capacity', not both")
        if self.efficiency < MIN_EFFICIENCY:
            what = f"'efficiency' {self.efficiency:g} is below {MIN_EFFICIENCY:g}: most of the water would be lost"
            raise ValueError(f"{what}; give the share that reaches the root zone, such as 0.8")
        for name, dose_mm in (("steps_mm", self.steps_mm), ("min_dose_mm", self.min_dose_mm)):
            if dose_mm > self.max_dose_mm:
                raise ValueError(f"'{name}' {dose_mm:g} is larger than 'max_dose_mm' {self.max_dose_mm:g}")
        if self.target is not None and self.target_share != 1:
            raise ValueError("give 'target' or 'target_share', not both")
        if self.target is not None and self.field_capacity is not None and self.target > self.field_capacity:
            what = f"'target' {self.target:g} is above 'field_capacity' {self.field_capacity:g}"
            raise ValueError(f"{what}: the soil does not hold more against gravity, so it would drain")
        if self.full <= self.stress:
            key = "target_share" if self.target is None else "target"
            what = f"'{key}' {getattr(self, key):g}"
            raise ValueError(f"{what} is not above {self.stress:.3g}, where plants lack water")
        return self

    @property
    def doubt(self) -> str:
        """Doubt about the depth of the roots; empty for a usual one."""
        depth = self.root_depth_mm
        if depth >= SHALLOW_ROOTS_MM:
            return ""
        meant = f"write {10 * depth:g} if it is in cm; doses are small and often needed with so little soil"
        return f"root_depth_mm of {depth:g} is shallow for the roots of crops: {meant}"

    def left(self, share: float) -> tuple[float, float]:
        """Moisture when a share of the water between wilting point and field capacity is left, and its standard
        deviation [m^3/m^3]; NaN without the two limits.

        A soil that holds more water at field capacity holds more at the wilting point: errors of both are alike.
        """
        low, high = self.wilting_point, self.field_capacity
        if low is None or high is None:
            return math.nan, math.nan
        sds = self.wilting_point_sd or 0.0, self.field_capacity_sd or 0.0
        return high - (1 - share) * (high - low), share * sds[1] + (1 - share) * sds[0]

    @property
    def stress(self) -> float:
        """Moisture below which plants lack water [m^3/m^3]; NaN without wilting point and field capacity.

        Readily available water is the share ``depletion`` of the water between wilting point and field capacity
        (Allen et al. 1998, FAO Irrigation and drainage paper 56, equations 82 and 83).
        """
        return self.left(1 - self.depletion)[0]

    @property
    def full(self) -> float:
        """Moisture to fill the root zone to [m^3/m^3]; NaN if it is not known."""
        return self.left(self.target_share)[0] if self.target is None else self.target

    @property
    def doses_mm(self) -> NDArray[np.float64]:
        """Gross doses that the machine can apply, rising, without 0 [mm]."""
        doses = self.steps_mm * np.arange(1.0, math.floor(self.max_dose_mm / self.steps_mm + 1e-9) + 1)
        return np.asarray(doses[doses >= min(self.min_dose_mm, doses[-1]) - 1e-9])

    @property
    def dose_thresholds(self) -> tuple[float, ...]:
        """Moistures below which a place gets the next higher dose [m^3/m^3]; several steps at once occur as often.

        :raises InputError: if wilting point and field capacity are not known
        """
        if not math.isfinite(self.stress + self.full):
            what = "thresholds of the dose need the water that plants use"
            raise InputError(
                what, "give wilting_point and field_capacity, or texture, in the site file (irrigation)"
            )
        doses = np.concatenate([[0.0], self.doses_mm])
        moistures = self.full - (doses[1:] + doses[:-1]) / 2 * self.efficiency / self.root_depth_mm
        return tuple(np.minimum(moistures, self.stress)[moistures > 0][::-1].tolist())


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
    """Radius around the sensor that dominates its counts [m]; about 10 with the robot's shield. Left out, reports
    state that of a bare probe."""
    deconvolve_footprint: bool | None = None
    """Map of the rate at each place if true, of its mean over the footprint around it if false. Each place if
    left out, where the radius is given and the counts do not object."""
    vegetation_height_m: NotNegative = 0.0
    """Height of the vegetation during the calibration [m]; it shortens the footprint."""
    corrections: CorrectionSettings = CorrectionSettings()
    """Correction of the counts."""
    vegetation: Vegetation | None = None
    """Crop, for the biomass in a general calibration where ``corrections.biomass`` is left out."""
    sensor_sensitivity: Annotated[float, Field(gt=0, le=100)] | SensorModel | None = None
    """Counts of the whole sensor in units of the reference detector of the general calibration, or the model:
    CRS-1000, CRS-1000B, CRS-2000, CRS-2000B, LiFoil-2 or LiFoil-3 (lithium foil, number of tubes). With it, a site
    without N0 has a general calibration."""
    sensor_sensitivity_sd: NotNegative | None = None
    """Standard deviation of the sensitivity; 3 % if left out, 4 to 8 % of a model."""
    soil: Soil | None = None
    """Soil properties; without them only the rate is mapped."""
    calibration: Calibration | None = None
    """Calibration; without it the general one where the sensitivity is known, else only the rate is mapped. A
    calibration that is ``null`` asks for the rate alone."""
    irrigation: Irrigation = Irrigation()
    """Limits of dry and moist soil for the report."""

    def __repr_args__(self) -> Iterator[tuple[str, str]]:
        yield "name", self.name

    @model_validator(mode="before")
    @classmethod
    def _texture_of_soil(cls, values: Any) -> Any:
        """The texture of the soil is that for irrigation, unless this has limits of its own."""
        if not isinstance(values, dict):
            return values
        soil, irrigation = values.get("soil"), values.get("irrigation", {})
        texture = soil.get("texture") if isinstance(soil, dict) else getattr(soil, "texture", None)
        known = any(texture == name for name in TEXTURES)  # a misspelt one is a mistake of the soil alone
        if not known or not isinstance(irrigation, dict) or irrigation.keys() & _LIMITS_OF_SOIL:
            return values
        return {**values, "irrigation": {**irrigation, "texture": texture}}

    @model_validator(mode="after")
    def _consistent(self) -> Site:
        target, texture = self.irrigation.target, self.irrigation.texture
        if self.soil is not None and self.soil.texture and texture and texture != self.soil.texture:
            raise ValueError(
                f"soil 'texture' is {self.soil.texture}, irrigation 'texture' {texture}: one field has one soil; "
                "remove that of irrigation, which then is that of the soil"
            )
        own = None if texture else self.irrigation.field_capacity
        for name, limit in (("target", target), ("field_capacity", own)):
            pores = 1.0 if self.soil is None else soil_limits(self.soil.bulk_density_gcm3).saturation
            if limit is not None and limit > pores:
                raise ValueError(
                    f"irrigation '{name}' {limit:g} is above the pore volume {pores:.2f} of this soil"
                )
        if self.logger_time_zone and self.logger_utc_offset_hours is not None:
            raise ValueError("give 'logger_time_zone' or 'logger_utc_offset_hours', not both")
        _ = self.corrections_parameters  # fails for a value that is ``auto`` without a place
        return self

    @property
    def logger_clock(self) -> float | str | None:
        """Logger's clock minus UTC [h] or its time zone; ``None`` for that of the logger format."""
        return self.logger_time_zone or self.logger_utc_offset_hours

    @property
    def corrections_parameters(self) -> Corrections:
        """Parameters of the factors; a correction switched off is neutral."""
        parameters = self.corrections.parameters(self.location)
        if self.humidity_method != "universal":
            return parameters
        # The response is relative, and N0 may be unknown.
        unit = {"n0_cps": 1.0, "n0_sd_cps": None, "curve": "universal"}
        calibration = (self.calibration or Calibration(n0_cps=1.0)).model_copy(update=unit)
        soil = self.soil or Soil(bulk_density_gcm3=SIMULATED_DENSITY_GCM3)
        curve = calibration.curve_of(soil, self.reference_humidity_gm3)
        assert isinstance(curve, UniversalCurve)
        return replace(
            parameters, humidity_response=partial(curve.humidity_response, self.corrections.typical_vwc)
        )

    @property
    def humidity_method(self) -> Literal["linear", "universal"]:
        """Correction of counts for humidity."""
        settings = self.corrections.humidity
        if settings is None:
            return "linear"
        by_curve = self.calibration is not None and self.calibration.curve == "universal"
        return settings.method or ("universal" if by_curve else "linear")

    @property
    def reference_humidity_gm3(self) -> float:
        """Absolute humidity to which counts are corrected [g/m^3]."""
        return (self.corrections.humidity or HumidityCorrection()).reference_gm3

    @property
    def shield_radius_m(self) -> float:
        """Radius of the footprint if the file gives it [m]; else that of a bare probe, which has no limit."""
        return self.footprint_radius_m if "footprint_radius_m" in self.model_fields_set else math.inf

    @property
    def known_footprint_m(self) -> float:
        """Radius of the footprint if the file gives it or asks for its deconvolution [m]; 0 otherwise."""
        known = self.deconvolve_footprint or "footprint_radius_m" in self.model_fields_set
        return self.footprint_radius_m if known else 0.0

    @property
    def curve(self) -> MoistureCurve | None:
        """Calibration curve, ``None`` until the site has both soil properties and N0."""
        if self.soil is None or self.calibration is None:
            return None
        return self.calibration.curve_of(self.soil, self.reference_humidity_gm3)


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
    site = load_model(path, Site)
    calibration = site.calibration
    old = calibration is not None and "illustrative" not in calibration.model_fields_set
    if calibration is not None and old and "illustrative" in (calibration.note or ""):
        _log.warning("%s: write 'illustrative: true' below 'calibration': the note will not count", path)
        site = site.model_copy(update={"calibration": calibration.model_copy(update={"illustrative": True})})
    intensity = site.corrections.intensity
    if intensity is None or intensity.file is None or intensity.file.is_absolute():
        return site
    resolved = intensity.model_copy(update={"file": path.parent / intensity.file})
    corrections = site.corrections.model_copy(update={"intensity": resolved})
    return site.model_copy(update={"corrections": corrections})


# Calibration against soil cores: N0 and its uncertainty, written into the site file -----------------------------


@dataclass(frozen=True)
class N0Estimate:
    """N0, its standard deviation, and the parts of that from counting and from the cores (NaN if unknown)
    [counts/s].
    """

    n0_cps: float
    n0_sd_cps: float
    from_counting_cps: float
    from_cores_cps: float


def estimate_n0(
    rate_cps: float, rate_sd_cps: float, vwc: float, vwc_sd: float, unit_curve: MoistureCurve
) -> N0Estimate:
    """N0 in closed form, and its first-order standard deviation from counting and from the cores.

    :param rate_sd_cps: standard deviation of the rate [counts/s], ``rate / sqrt(raw counts)``
    :param vwc_sd: standard deviation of the moisture of the cores [m^3/m^3]; if NaN, only counting is included
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


def unusual_n0(n0_cps: float) -> str:
    """Doubt about an N0 that no sensor has; empty for a usual one.

    >>> unusual_n0(1111.0)
    'N0 of 1111 counts/s is unusual: 0.3086 counts/s if it is per hour, 18.52 counts/s if it is per minute'
    """
    low, high = USUAL_N0_CPS
    if low <= n0_cps <= high:
        return ""
    meant = [
        f"{n0_cps / time_s:.4g} counts/s if it is per {time}"
        for time, time_s in OTHER_TIMES.items()
        if low <= n0_cps / time_s <= high
    ]
    return f"N0 of {n0_cps:g} counts/s is unusual{': ' + ', '.join(meant) if meant else ''}"


def n0_in_other_time(rate_cps: float, curve: MoistureCurve) -> str:
    """Doubt about an N0 per hour, minute or 10 s instead of per second; empty if the mean rate fits N0."""
    limits = soil_limits(curve.bulk_density_gcm3)
    most, least = (float(curve.rate_cps(vwc)) for vwc in (limits.dryness, limits.saturation))
    if not least <= rate_cps <= most:
        for time, time_s in OTHER_TIMES.items():
            if least <= rate_cps * time_s <= most:
                meant = f"per {time}: {curve.n0_cps / time_s:.4g} counts/s"
                return f"N0 of {curve.n0_cps:g} counts/s fits these counts if it is {meant}"
    return ""


def write_calibration(site_file: Path, calibration: Calibration, soil: Soil | None = None) -> None:
    """Write a calibration (and soil properties, if given) into a site file, preserving comments and order.

    :raises InputError: if the file cannot be read or written
    """
    known = calibration.model_dump(exclude_defaults=True)
    for part in known.get("parts", []):
        for name in [name for name, value in part.items() if value != value]:  # NaN is the default
            del part[name]
    values: dict[str, Any] = {"calibration": known}
    if soil is not None:
        values["soil"] = soil.model_dump(exclude_none=True, exclude_unset=True)
    write_site_values(site_file, values)


def write_site_values(site_file: Path, values: Mapping[str, Any]) -> None:
    """Write values of keys into a site file, preserving comments and order.

    The file is replaced atomically: a crash leaves either the old or the new file.

    :raises InputError: if the file cannot be read or written
    """
    content = read_yaml(site_file)
    if isinstance(had := content.get("soil"), dict) and "soil" in values:  # its comments stay
        had.update(values["soil"])
        values = {name: value for name, value in values.items() if name != "soil"}
    content.update(values)
    text = StringIO()
    yaml = YAML(typ="rt")
    yaml.width = 120
    yaml.dump(content, text)
    temporary = site_file.with_name(site_file.name + ".tmp")
    try:
        temporary.write_text(text.getvalue(), encoding="utf-8")
        load_site(temporary)  # an unreadable file must not replace a valid one
        os.replace(temporary, site_file)
    except InputError as error:
        raise InputError([replace(one, path=site_file) for one in error.mistakes]) from None
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "check its permissions", site_file) from None
    finally:
        temporary.unlink(missing_ok=True)
