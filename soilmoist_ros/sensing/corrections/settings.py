# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The corrections of a site file, and the parameters that follow from them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from soilmoist_ros.foundation import Section, did_you_mean
from soilmoist_ros.sensing.corrections.factors import (
    BIOMASS_WATER_SHARE_M2KG,
    DRY_BIOMASS_SHARE_M2KG,
    Corrections,
    barometric_coefficient,
    f_biomass,
    f_road,
    standard_pressure_hpa,
)
from soilmoist_ros.sensing.corrections.intensity import (
    MONITORS,
    CosmicPlace,
    Scaling,
    cosmic_place,
    intensity_scale,
)

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Rigidity = Annotated[float, Field(ge=0, le=20)]
Latitude = Annotated[float, Field(ge=-90, le=90)]
Longitude = Annotated[float, Field(ge=-180, le=180)]
Altitude = Annotated[float, Field(ge=-500, le=9000)]


def _from_the_place(value: Any) -> Any:
    return None if value == "auto" else value


AUTO = BeforeValidator(_from_the_place)
"""Reads the word ``auto`` as ``None``: the value follows from the place."""


class Location(Section):
    """A place on the earth."""

    latitude_deg: Latitude
    """Latitude, WGS-84 [deg]."""
    longitude_deg: Longitude
    """Longitude, WGS-84, east positive [deg]."""
    altitude_m: Altitude | None = None
    """Altitude above mean sea level [m]."""


class PressureCorrection(Section):
    """Factor ``exp(beta (P - P0))``."""

    beta_per_hpa: Annotated[Annotated[float, Field(gt=0, lt=0.1)] | None, AUTO] = 0.0077
    """Barometric coefficient [1/hPa]; ``auto`` computes it from the place."""
    reference_hpa: Annotated[Annotated[float, Field(gt=300, lt=1200)] | None, AUTO] = 1013.25
    """Pressure at which the factor is 1 [hPa]; ``auto``: that of the standard atmosphere at the place."""


class HumidityCorrection(Section):
    """Factor ``1 + c (Q - Q0)``, or the response of the universal transport solution."""

    method: Literal["linear", "universal"] | None = None
    """Form of the humidity correction; by default the one that belongs to the curve of the calibration."""
    coefficient_m3g: Annotated[float, Field(ge=0, lt=0.1)] = 0.0054
    """Coefficient c [m^3/g] (Rosolem et al. 2013)."""
    reference_gm3: Annotated[float, Field(ge=0, lt=60)] = 0.0
    """Absolute humidity at which the factor is 1 [g/m^3]."""


def _monitor_code(code: Any) -> str | None:
    if code is None:
        return None
    if not isinstance(code, str):
        raise ValueError("a monitor is given by its code in the database NMDB alone, such as JUNG")
    if code.upper() not in MONITORS:
        known = ", ".join(MONITORS)
        raise ValueError(f"there is no monitor {code!r} among {known}{did_you_mean(code.upper(), list(MONITORS))}")
    return code.upper()


class IntensityCorrection(Section):
    """Factor ``1 / (1 + k (C / C0 - 1))`` from a neutron monitor."""

    reference: Positive
    """Neutron-monitor rate C0 at which the factor is 1 (the monitor's unit)."""
    constant: Positive | None = None
    """One rate C for the whole survey, in the unit of the reference."""
    file: Path | None = None
    """Rates C in time, as exported from nmdb.eu; a relative path starts at the site file."""
    monitor: Annotated[str | None, BeforeValidator(_monitor_code)] = None
    """Code of the neutron monitor in the database NMDB, such as JUNG."""
    scaling: Scaling = "none"
    """Conversion of a change at the monitor into one at the site: none, hawdon2014 or mcjannet2023."""
    gaps: Literal["interpolate"] = "interpolate"
    """No longer a setting: a file may only have the value that is used."""
    max_gap_hours: Annotated[float, Field(ge=0, le=240)] = 6.0
    """Longest gap of the file that is interpolated [h]; records in longer ones cannot be corrected."""

    @model_validator(mode="after")
    def _consistent(self) -> IntensityCorrection:
        if (self.constant is None) == (self.file is None):
            raise ValueError("give the incoming intensity either as 'constant' or as 'file'")
        if self.scaling != "none" and self.monitor is None:
            raise ValueError(f"the scaling {self.scaling} needs a 'monitor', such as JUNG")
        return self


class BiomassCorrection(Section):
    """Factor ``1 / (1 - share * biomass)`` for the plants above the ground."""

    water_equivalent_kgm2: NotNegative | None = None
    """Biomass water equivalent [kg/m^2], ``fresh - dry + 0.494 dry`` (cellulose: Wahbi & Avery 2018, In situ
    destructive sampling, Springer); or give the dry biomass."""
    dry_kgm2: NotNegative | None = None
    """Dry biomass [kg/m^2]."""

    @model_validator(mode="before")
    @classmethod
    def _without_fresh(cls, values: Any) -> Any:
        if isinstance(values, dict) and "fresh_kgm2" in values:
            raise ValueError("'fresh_kgm2' is gone: give water_equivalent_kgm2, fresh - 0.506 dry biomass, alone")
        return values

    @model_validator(mode="after")
    def _consistent(self) -> BiomassCorrection:
        if (self.water_equivalent_kgm2 is None) == (self.dry_kgm2 is None):
            raise ValueError("give the biomass either as 'water_equivalent_kgm2' or as 'dry_kgm2'")
        f_biomass(*self.used)  # fails for more than plants can have
        return self

    @property
    def used(self) -> tuple[float, float]:
        """Biomass [kg/m^2] and share of the counts that 1 kg/m^2 takes [m^2/kg]."""
        if self.water_equivalent_kgm2 is not None:
            return self.water_equivalent_kgm2, BIOMASS_WATER_SHARE_M2KG
        return self.dry_kgm2 or 0.0, DRY_BIOMASS_SHARE_M2KG


class RoadCorrection(Section):
    """Factor for a probe that drives on a road, with the typical moisture of the field."""

    width_m: Annotated[float, Field(ge=0, le=30)]
    """Width of the road [m]."""
    vwc: Annotated[float, Field(ge=0, le=0.25)] = 0.12
    """Moisture of the road [m^3/m^3]."""
    distance_m: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Distance of the probe from the middle of the road [m]."""


class CorrectionSettings(Section):
    """The corrections to apply; ``null`` switches a correction off."""

    place: Location | None = None
    """Place from which ``auto`` values follow; the location of the site if left out."""
    cutoff_rigidity_gv: Rigidity | None = None
    """Vertical cutoff rigidity of the place [GV]; from a table of the world if left out."""
    pressure: PressureCorrection | None = PressureCorrection()
    humidity: HumidityCorrection | None = HumidityCorrection()
    intensity: IntensityCorrection | None = None
    biomass: BiomassCorrection | None = None
    road: RoadCorrection | None = None
    typical_vwc: Annotated[float, Field(ge=0, le=1)] = 0.2
    """Moisture of the field at which corrections that depend on the moisture are exact [m^3/m^3]."""

    @property
    def f_road(self) -> float:
        """Factor of the road [-]; 1 without a road."""
        road = self.road
        return 1.0 if road is None else f_road(road.width_m, road.vwc, self.typical_vwc, road.distance_m)

    @property
    def f_biomass(self) -> float:
        """Factor of the plants [-]; 1 without biomass."""
        return 1.0 if self.biomass is None else f_biomass(*self.biomass.used)

    def cosmic(self, location: Location | None) -> CosmicPlace | None:
        """Cutoff rigidity and atmospheric depth of the place, else of the site; ``None`` without its altitude."""
        place = self.place or location
        if place is None or place.altitude_m is None:
            return None
        return cosmic_place(place.latitude_deg, place.longitude_deg, place.altitude_m, self.cutoff_rigidity_gv)

    def parameters(self, location: Location | None) -> Corrections:
        """Parameters of the factors at the location of a site; a correction switched off is neutral.

        :raises ValueError: if a value follows from the place and the place is unknown
        """
        pressure = self.pressure or PressureCorrection()
        humidity = self.humidity or HumidityCorrection(coefficient_m3g=0.0)
        beta, reference_hpa, scale = pressure.beta_per_hpa, pressure.reference_hpa, 1.0
        scaling = "none" if self.intensity is None else self.intensity.scaling
        auto = {"beta_per_hpa": beta is None, "reference_hpa": reference_hpa is None, "scaling": scaling != "none"}
        if any(auto.values()):
            place, cosmic = self.place or location, self.cosmic(location)
            if place is None or place.altitude_m is None or cosmic is None:
                key = next(key for key in auto if auto[key])
                raise ValueError(
                    f"{key!r} follows from the place: give latitude_deg, longitude_deg and "
                    "altitude_m as 'location', or as 'place' below 'corrections'"
                )
            beta = beta or barometric_coefficient(cosmic.depth_gcm2, cosmic.cutoff_rigidity_gv)
            reference_hpa = reference_hpa or standard_pressure_hpa(place.latitude_deg, place.altitude_m)
            if self.intensity is not None and self.intensity.monitor is not None:
                monitor = cosmic_place(*MONITORS[self.intensity.monitor][1:])
                scale = intensity_scale(self.intensity.scaling, cosmic, monitor)
        assert beta is not None
        assert reference_hpa is not None
        return Corrections(
            beta_per_hpa=beta, reference_pressure_hpa=reference_hpa,
            humidity_coefficient_m3g=humidity.coefficient_m3g, reference_humidity_gm3=humidity.reference_gm3,
            reference_intensity=self.intensity.reference if self.intensity else None, intensity_scale=scale,
            f_surroundings=self.f_biomass * self.f_road,
        )  # fmt: skip
