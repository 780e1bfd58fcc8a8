# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""General calibration: N0 of a sensor without soil cores, and what is uncertain about it.

Heistermann, Francke, Schrön & Oswald (2024), Hydrology and Earth System Sciences 28:989-1000, found that one N0
fits 75 sites in Europe, once the counts are divided by the sensitivity of the sensor and scaled to one place.
Their 104 calibrations (``data/caldata.csv`` of github.com/cosmic-sense/local-or-global, MIT licence) were fitted
again with the corrections and scaling of this package, one weight a site (``test_general.py``):

* :data:`GENERAL_N0_CPS` is the rate over dry soil of their reference detector, the "calibrator" of Jülich, in dry
  air at 1013.25 hPa, a cutoff rigidity of :data:`RIGIDITY_GV` and the intensity at which Jungfraujoch counts
  :data:`JUNG_CPS`;
* a day at a site differs from it by :data:`GENERAL_SD` and :data:`SCALING_SD`, and by :data:`MODEL_SD` where
  only the model of the sensor is known. Normals of two widths predict sites that were left out better (mean log
  score 1.56) than Student's t (1.51) or one normal (1.46): the tails are those of CRS-1000 and CRS-1000B, whose
  sensitivity the authors took from the model. Errors of cores, densities and biomass are in these deviations. The
  authors' standard deviation of the *mean* N0, 15 to 18 of 2306 counts/h, is not the error of one site;
* days of one site scatter by :data:`DAY_SD` (29 degrees of freedom), the error of their cores included.
A range that nobody measured is a *default range*; no message calls it a measurement.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, Literal, NamedTuple

import numpy as np

from soilmoist_ros.sensing.corrections.factors import (
    DRY_BIOMASS_SHARE_M2KG,
    SEA_LEVEL_HPA,
    Corrections,
    barometric_coefficient,
    gravity_ms2,
    standard_pressure_hpa,
)  # fmt: skip
from soilmoist_ros.sensing.corrections.intensity import cosmic_place
from soilmoist_ros.sensing.moisture.curve import MoistureCurve, soil_limits
from soilmoist_ros.sensing.moisture.site import (
    UNKNOWN_SENSOR,
    Calibration,
    Crop,
    SensorModel,
    Site,
    Soil,
    Stage,
    UncertaintyPart,
)  # fmt: skip

Origin = Literal["measured", "given", "default range", "literature"]
SdOrigin = Literal["given", "literature", "assumed"]

GENERAL_N0_CPS = 0.6905
"""N0 of the reference detector [counts/s]: 2486 counts/h, see the module."""
RIGIDITY_GV = 2.893
"""Vertical cutoff rigidity of the reference place, Marquardt near Potsdam, by the table of this package [GV]."""
GENERAL_SD = 0.036
"""Standard deviation of log N0 of a day at a site. With :data:`SCALING_SD` an *effective* one, 0.042 = q / 1.645,
where q is the conformal 90 % quantile (Vovk et al. 2005, Algorithmic learning in a random world) of the deviations
at the 49 sites with other sensors than CRS-1000 and CRS-1000B, each site with one weight."""
SCALING_SD = 0.021
"""Standard deviation of log N0 by the scaling between places, against the model PARMA."""
DAY_SD = 0.028
"""Standard deviation of log N0 between days of one site."""
SCALED_HPA, SCALED_GV = (840.0, 1060.0), (1.5, 8.6)
"""Pressures and rigidities of the 75 sites; the scaling is twice as uncertain beyond."""
JUNG_CPS, JUNG_SD = 161.8, 0.004
"""Rate of the monitor Jungfraujoch (IGY) at the intensity of N0 [counts/s], and its relative standard deviation:
the authors' factors times the rates of NMDB at the same times, ten days of 2011 to 2016."""
INTENSITY, INTENSITY_SD = 0.985, 0.035
"""Default range of the intensity in units of that of N0: Jungfraujoch 2010 to 2019, values of NMDB, has
0.985 +- 0.029, and 0.935 to 1.026 nine times in ten; older solar maxima were lower."""
HUMIDITY_GM3, HUMIDITY_SD_GM3 = 8.0, 4.0
"""Default range of the absolute humidity [g/m^3]: 4 to 14 in the calibrations of the table."""
WEATHER_HPA, BAROMETER_HPA = 8.0, 1.5
"""Standard deviations of the air pressure of a day around the mean of its altitude, and of a barometer [hPa]."""
DENSITY_GCM3, DENSITY_SD_GCM3 = 1.3, 0.15
"""Default range of the dry bulk density [g/cm^3]: cropland of the table has 1.26 +- 0.12, texture classes 1.26 to
1.50."""
BOUND_WATER, BOUND_WATER_SD = 0.035, 0.018
"""Default range of lattice and organic water [g/g]: cropland of the table has 0.029 +- 0.011, grassland more."""
ORGANIC_GCM3 = 0.8
"""Bulk density below which a soil is organic: its organic water is far above the default range [g/cm^3]."""
DENSITY_ERROR = 0.07
WATER_ERROR = 0.01
"""Errors of a density (relative) and of bound water [g/g] that a user gives without one."""
ORGANIC_ERROR = (2.5 - 1.4) / math.sqrt(12) / 2
"""Relative error of organic water, 16 %: organic matter is 1.4 to 2.5 times its carbon (Pribyl 2010, Geoderma
156:75, abstract), taken as uniform about 2. Kinds of peat scatter by 5 to 15 % (Klingenfuß et al. 2014, Geoderma
235-236:410, abstract)."""
BIOMASS_KGM2, BIOMASS_SD_KGM2 = 0.5, 0.5
"""Default range of the dry biomass above the ground [kg/m^2]: bare soil to a full crop, without forest."""
COLD_DEGC = 2.0
"""Mean temperature below which snow may lie [degC]."""

SENSITIVITIES: dict[SensorModel, float] = {
    "CRS-1000": 0.45, "CRS-1000B": 0.67, "CRS-2000": 0.87, "CRS-2000B": 1.15, "LiFoil-2": 0.83,
    "LiFoil-3": 1.25,
}  # fmt: skip
"""Counts of sensor models in units of the reference detector. Of Hydroinnova: ``docs/README.md`` of the authors.
Of Radiation Detection Technologies, lithium foil in 2 or 3 tubes: 3 tubes at the Konza Prairie (Patrignani et
al. 2021, Frontiers in Water 3:673185), N0 of four surveys of moisture with 0.28 m^3/m^3 over the general one:
1.27, 1.24, 1.27, 1.21. They counted 1.065 times as much as a BF3 probe next to them, which gives 1.22 if that
was a CRS-2000B."""
MODEL_SD: dict[SensorModel, float] = {
    "CRS-1000": 0.081, "CRS-1000B": 0.081, "CRS-2000": 0.04, "CRS-2000B": 0.04, "LiFoil-2": 0.07,
    "LiFoil-3": 0.07,
}  # fmt: skip
"""Relative standard deviations of the sensitivity of one sensor of a model. CRS-1000 and CRS-1000B: what the 26
sites with them deviate more than the others; of nine CRS-2000B next to the reference; of lithium foil mostly the
deviation of its one site."""
_CRS = re.compile(r"\bCRS[ _-]?([12]000)(?:[ _/-]?(B))?(?![A-Za-z0-9])", re.IGNORECASE)
GIVEN_SD = 0.03
"""Relative standard deviation of a sensitivity that a user gives without one."""

CROPS: dict[Crop, float] = {
    "bare": 0.0, "grass": 0.4, "alfalfa": 0.5, "wheat": 1.5, "barley": 1.3, "rapeseed": 1.2, "maize": 2.0,
    "soybean": 0.8, "sugar beet": 0.6, "potato": 0.4,
}  # fmt: skip
"""Dry biomass above the ground of a full stand [kg/m^2]: usual yields over the harvest indices of Hay (1995),
Annals of Applied Biology 126:197-216, such as 0.7 kg/m^2 of grain over 0.45 for wheat; of roots and tubers the
leaves only."""
STAGES: dict[Stage, tuple[float, float]] = {"emerged": (0.1, 0.1), "growing": (0.5, 0.25), "full": (1.0, 0.3)}
"""Share of the full stand at a stage, and its standard deviation."""


@dataclass(frozen=True)
class SurveyAir:
    """Place and air of a survey, NaN for what is unknown.

    :param pressure_hpa: mean air pressure of the records [hPa]
    :param temperature_degc: their mean temperature [degC]
    :param humidity_gm3: their mean absolute humidity [g/m^3], to say it
    """

    latitude_deg: float = math.nan
    longitude_deg: float = math.nan
    pressure_hpa: float = math.nan
    temperature_degc: float = math.nan
    humidity_gm3: float = math.nan


class Sensitivity(NamedTuple):
    """Counts in units of the reference detector, their standard deviation, and where both are from."""

    value: float
    sd: float
    origin: Origin
    sd_origin: SdOrigin | None = None


def _part(
    name: Any, value: float, unit: str, sd: float, origin: Origin, share: float = math.nan,
    sd_origin: SdOrigin | None = None,
) -> UncertaintyPart:  # fmt: skip
    return UncertaintyPart(
        name=name, value=value, unit=unit, sd=sd, origin=origin, share=share, sd_origin=sd_origin
    )


def sensitivity_of(site: Site) -> Sensitivity | None:
    """Sensitivity of the sensor of a site; ``None`` if the site file does not say it."""
    given, sd = site.sensor_sensitivity, site.sensor_sensitivity_sd
    if given is None:
        return None
    if isinstance(given, str):
        value = SENSITIVITIES[given]
        if sd is None:
            return Sensitivity(value, MODEL_SD[given] * value, "literature")
        return Sensitivity(value, sd, "literature", "given")
    return (
        Sensitivity(given, GIVEN_SD * given, "given", "assumed") if sd is None else Sensitivity(given, sd, "given")
    )


def location_factor(pressure_hpa: float, rigidity_gv: float, latitude_deg: float) -> float:
    """Rate of a sensor at a place in units of that at the reference place, 1013.25 hPa and :data:`RIGIDITY_GV`
    [-].

    Down from the pressure the flux falls by the barometric coefficient of Desilets (2021); with the rigidity R it
    changes as ``1 - exp(-9.694 R^-0.9954)`` (Dorman's function with the parameters of Desilets, Zreda & Prabu
    2006, Earth and Planetary Science Letters 246:265-276). Against the model PARMA, which the authors use, it
    scatters by :data:`SCALING_SD` over the 75 sites.
    """
    pressures = np.linspace(pressure_hpa, SEA_LEVEL_HPA, 41)
    gravity = gravity_ms2(latitude_deg, 0.0)
    betas = [barometric_coefficient(float(10 * one / gravity), rigidity_gv) for one in pressures]
    # The trapezoidal rule: its name differs between NumPy 1 and 2.
    attenuated = float(np.mean(np.add(betas[1:], betas[:-1])) / 2 * (pressures[-1] - pressures[0]))
    return math.exp(attenuated) * _dorman(rigidity_gv) / _dorman(RIGIDITY_GV)


def _dorman(rigidity_gv: float) -> float:
    return 1 - math.exp(-9.694 * max(rigidity_gv, 0.1) ** -0.9954)


def why_no_soil(site: Site) -> str:
    """Why the soil of a site allows no general calibration: peat whose organic matter is not given; else empty."""
    soil = site.soil
    if soil is None or soil.bulk_density_gcm3 >= ORGANIC_GCM3 or soil.organic_carbon is not None:
        return ""
    mineral = Soil.model_validate({"texture": soil.texture}).organic_water if soil.texture else math.nan
    if "organic_water" in soil.model_fields_set and soil.organic_water != mineral:
        return ""
    return f"the bulk density of {soil.bulk_density_gcm3:g} g/cm3 is that of an organic soil: give organic_carbon"


def soil_of(site: Site) -> tuple[Soil, list[UncertaintyPart]]:
    """Soil of a site with a range for what its file leaves out, and the two parts of the uncertainty."""
    soil = site.soil or Soil(bulk_density_gcm3=DENSITY_GCM3, bulk_density_sd_gcm3=DENSITY_SD_GCM3)
    typical = Soil.model_validate({"texture": soil.texture}) if soil.texture else None

    def origin(*names: str) -> Origin:
        # By value: a site file that soilmoist calibrate wrote holds all values.
        of_class = typical and all(getattr(soil, name) == getattr(typical, name) for name in names)
        return "default range" if site.soil is None or of_class else "given"

    known = {"lattice_water", "organic_water", "clay", "organic_carbon"} & soil.model_fields_set
    of_density: SdOrigin | None = "assumed" if soil.bulk_density_sd_gcm3 is None else None
    of_water: SdOrigin | None = "assumed" if known and soil.bound_water_sd is None else None
    changed: dict[str, float] = {}
    if of_density:
        changed["bulk_density_sd_gcm3"] = DENSITY_ERROR * soil.bulk_density_gcm3
    if not known:
        changed |= {"lattice_water": BOUND_WATER, "bound_water_sd": BOUND_WATER_SD}
    elif of_water:
        changed["bound_water_sd"] = math.hypot(WATER_ERROR, ORGANIC_ERROR * soil.organic_water)
    full = soil.model_copy(update=changed)
    water = full.lattice_water + full.organic_water
    return full, [
        _part(
            "bulk density", full.bulk_density_gcm3, "g/cm3", full.bulk_density_sd_gcm3 or 0.0,
            origin("bulk_density_gcm3"), sd_origin=of_density,
        ),
        _part(
            "lattice and organic water", round(water, 5), "g/g", full.bound_water_sd or 0.0,
            origin("lattice_water", "organic_water") if known else "default range", sd_origin=of_water,
        ),
    ]  # fmt: skip


def general_calibration(site: Site, air: SurveyAir) -> tuple[Calibration, Soil] | None:
    """Calibration and soil of a site without N0, in the references of its corrections.

    ``N0 = N0_general * sensitivity * location * intensity * biomass / humidity``, the location at the pressure to
    which the site corrects. The relative errors of the factors are independent and add up by their squares.

    :returns: ``None`` without a sensitivity, where neither the place nor the pressure of its altitude is known, or
        for peat, see :func:`why_no_soil`
    """
    sensitivity, scale = sensitivity_of(site), _scaling(site, air)
    if sensitivity is None or scale is None or why_no_soil(site):
        return None
    share, (changing, of_changing) = sensitivity.sd / sensitivity.value, _changing(site, air)
    parts = [
        _part("general N0", GENERAL_N0_CPS, "counts/s", GENERAL_SD * GENERAL_N0_CPS, "literature", GENERAL_SD),
        _part("sensitivity", sensitivity.value, "of the reference", sensitivity.sd, sensitivity.origin, share,
              sensitivity.sd_origin),
        *scale.parts, *of_changing,
    ]  # fmt: skip
    soil, of_soil = soil_of(site)
    n0_cps = GENERAL_N0_CPS * sensitivity.value * scale.factor * changing
    total = math.hypot(*(part.share for part in parts if not math.isnan(part.share)))
    snow = "; snow is not accounted for" if air.temperature_degc < COLD_DEGC else ""
    note = (
        f"general calibration after Heistermann et al. (2024): sensitivity {sensitivity.value:g}, "
        f"{scale.rigidity_gv:.1f} GV, {scale.pressure_hpa:.0f} hPa{snow}"
    )
    calibration = Calibration(
        n0_cps=float(f"{n0_cps:.5g}"), n0_sd_cps=float(f"{total * n0_cps:.4g}"), method="general",
        parts=[*parts, *of_soil], note=note,
    )  # fmt: skip
    return calibration, soil


def unknown_sensor(site: Site, air: SurveyAir, rate_cps: float) -> tuple[Calibration, Soil] | None:
    """Calibration and soil of a site whose sensor nobody named, by the mean rate of its field.

    With any sensitivity as likely as its double, and a mean moisture uniform between dry soil and full pores, the
    moisture is as uniform after the survey. So the mean rate means half of the pores, and N0 is so uncertain that
    the 90 % interval begins at a twentieth of them; as the curve bends, it ends with full pores.

    :returns: ``None`` without counts, or for peat, see :func:`why_no_soil`
    """
    if not rate_cps > 0 or why_no_soil(site):
        return None
    soil, of_soil = soil_of(site)
    unit, pores = Calibration(n0_cps=1.0).curve_of(soil), soil_limits(soil.bulk_density_gcm3).saturation
    n0_cps, share = rate_cps / float(unit.rate_cps(0.5 * pores)), unknown_share(unit)
    note = "unknown sensor: the level is between nearly dry soil and full pores"
    if by_model := ", ".join(_by_model(site, air, rate_cps, pores)):
        note += f"; these counts would mean {by_model}"
    part = _part(UNKNOWN_SENSOR, float(f"{n0_cps:.5g}"), "counts/s", share * n0_cps, "default range", share)
    calibration = Calibration(
        n0_cps=float(f"{n0_cps:.5g}"), n0_sd_cps=float(f"{share * n0_cps:.4g}"), method=UNKNOWN_SENSOR,
        illustrative=True, parts=[part, *of_soil], note=note,
    )  # fmt: skip
    return calibration, soil


def unknown_share(curve: MoistureCurve) -> float:
    """Relative standard deviation of an N0 of which nothing is known but the pores, see :func:`unknown_sensor`."""
    pores = soil_limits(curve.bulk_density_gcm3).saturation
    dry, middle = curve.rate_cps([0.05 * pores, 0.5 * pores]).tolist()
    return float(dry / middle - 1) / NormalDist().inv_cdf(0.95)


def _by_model(site: Site, air: SurveyAir, rate_cps: float, pores: float) -> Iterator[str]:
    """Sensor models with which a rate has a possible moisture, and its 90 % interval by N0, the driest first."""
    for model in sorted(SENSITIVITIES, key=lambda model: SENSITIVITIES[model]):
        found = general_calibration(site.model_copy(update={"sensor_sensitivity": model}), air)
        if found is None:
            return
        curve = found[0].curve_of(found[1])
        away = NormalDist().inv_cdf(0.95) * curve.n0_sd_cps / curve.n0_cps
        dry, middle, wet = curve.vwc([rate_cps * (1 + away), rate_cps, rate_cps * (1 - away)]).tolist()
        if 0 < middle < pores:
            wettest = pores if math.isnan(wet) else min(wet, pores)
            yield f"{100 * max(dry, 0.0):.0f} to {100 * wettest:.0f} % by volume with a {model}"


def named_sensor(texts: Iterable[str]) -> SensorModel | None:
    """The one sensor model that texts name, such as the header of a log; ``None`` for none, or for several.

    >>> named_sensor(["Hydroinnova CRS2000/B", "Record period = 15 minutes"])
    'CRS-2000B'
    """
    found = {f"CRS-{size}{kind.upper()}" for text in texts for size, kind in _CRS.findall(text)}
    models = [model for model in SENSITIVITIES if model in found]
    return models[0] if len(models) == 1 else None


class _Scaling(NamedTuple):
    """Factor from the reference place to the rates of a site at its reference pressure, and its parts."""

    factor: float
    rigidity_gv: float
    pressure_hpa: float
    parts: list[UncertaintyPart]


def _scaling(site: Site, air: SurveyAir) -> _Scaling | None:
    place = site.corrections.place or site.location
    latitude = air.latitude_deg if place is None else place.latitude_deg
    longitude = air.longitude_deg if place is None else place.longitude_deg
    altitude = None if place is None else place.altitude_m
    if math.isnan(latitude) or math.isnan(longitude):
        return None
    pressure, sd_hpa = air.pressure_hpa, BAROMETER_HPA
    origin: Origin = "measured"
    sd_origin: SdOrigin | None = "assumed"
    if math.isnan(pressure):
        if altitude is None:
            return None
        pressure, sd_hpa = standard_pressure_hpa(latitude, altitude), WEATHER_HPA
        origin, sd_origin = "default range", None
    rigidity = cosmic_place(latitude, longitude, 0.0, site.corrections.cutoff_rigidity_gv).cutoff_rigidity_gv
    factor, parameters = location_factor(pressure, rigidity, latitude), site.corrections_parameters
    if site.corrections.pressure is not None:
        factor *= parameters.f_pressure(pressure)
    inside = SCALED_HPA[0] <= pressure <= SCALED_HPA[1] and SCALED_GV[0] <= rigidity <= SCALED_GV[1]
    scaling_sd = SCALING_SD if inside else 2 * SCALING_SD
    parts = [
        _part("site scaling", factor, "factor", scaling_sd * factor, "literature", scaling_sd),
        _part("pressure", pressure, "hPa", sd_hpa, origin, parameters.beta_per_hpa * sd_hpa, sd_origin),
    ]
    return _Scaling(factor, rigidity, pressure, parts)


def _changing(site: Site, air: SurveyAir) -> tuple[float, list[UncertaintyPart]]:
    """Rate at the intensity, humidity and plants of a site's references in units of that of N0, and the parts of
    all that changes in time.
    """
    settings, coefficient = site.corrections, Corrections.humidity_coefficient_m3g
    origin: Origin = "default range"
    level, sd = INTENSITY, INTENSITY_SD
    intensity = settings.intensity
    if intensity is not None and intensity.monitor == "JUNG":
        scale = site.corrections_parameters.intensity_scale
        level, sd, origin = 1 + scale * (intensity.reference / JUNG_CPS - 1), JUNG_SD, "measured"
    parts = [_part("intensity", level, "of that of N0", level * sd, origin, sd)]
    if settings.humidity is None:
        corrected_to_gm3, sd = HUMIDITY_GM3, HUMIDITY_SD_GM3
        parts.append(_part("humidity", HUMIDITY_GM3, "g/m3", sd, "default range", coefficient * sd))
    else:
        corrected_to_gm3, sd = site.reference_humidity_gm3, 0.3
        parts.append(_part("humidity", air.humidity_gm3, "g/m3", sd, "measured", coefficient * sd, "assumed"))
    biomass, sd, origin = _biomass(site)
    assumed: SdOrigin | None = "assumed" if origin == "given" else None
    parts.append(_part("biomass", biomass, "kg/m2", sd, origin, DRY_BIOMASS_SHARE_M2KG * sd, assumed))
    if settings.road is not None:
        sd = abs(settings.f_road - 1) / 3  # the road's moisture and width are rough
        parts.append(_part("road", settings.f_road, "factor", sd, "given", sd, "assumed"))
    if air.temperature_degc < COLD_DEGC:
        parts.append(_part("snow", math.nan, "mm", 0.0, "default range"))
    # Counts that are corrected for plants are those of bare soil.
    plants = 1.0 if settings.biomass is not None else 1 - DRY_BIOMASS_SHARE_M2KG * biomass
    return level * plants / (1 + coefficient * corrected_to_gm3), parts


def _biomass(site: Site) -> tuple[float, float, Origin]:
    """Biomass above the ground [kg/m^2], its standard deviation, and where it is from; dry but where the site file
    gives a water equivalent.
    """
    if site.corrections.biomass is not None:
        value = site.corrections.biomass.used[0]
        return value, 0.25 * value, "given"
    if site.vegetation is None:
        return BIOMASS_KGM2, BIOMASS_SD_KGM2, "default range"
    full, (share, share_sd) = CROPS[site.vegetation.crop], STAGES[site.vegetation.stage]
    return full * share, max(full * share_sd, 0.05), "default range"
