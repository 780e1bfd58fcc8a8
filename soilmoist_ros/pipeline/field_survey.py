# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A map that grows, opened from the files of a field and a site, and saved as an output folder."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from soilmoist_ros import sensing
from soilmoist_ros.exploration import OF_DOSE, Thresholds, check_target, check_thresholds, parse_thresholds
from soilmoist_ros.foundation import Health, InputError, Level, LocalFrame, __version__, resource, shown_path
from soilmoist_ros.mapping import (
    CovariateSource,
    Field,
    FieldMap,
    FieldMapSettings,
    Knowledge,
    MappingSettings,
    MapState,
    Samples,
    Skip,
    Snapshot,
    SoilMap,
    load_field,
    read_covariates,
)
from soilmoist_ros.pipeline.earlier_runs import (
    EarlierTarget,
    mean_rate,
    read_earlier_runs,
    require_other,
    run_change,
    with_corrections,
)
from soilmoist_ros.pipeline.run import (
    CalibrationInfo,
    CorrectionRow,
    EarlierRun,
    InputFile,
    LossRow,
    MapRun,
    Note,
    NoteCode,
)

MAX_BEYOND_AREA_DEG = 6.0  # largest distance of a field from the area of its reference system: one UTM zone [deg]
_SNOW = "counts have no air temperature, so nothing says if snow lay, which would count as soil water"


@dataclass(frozen=True)
class FieldSurvey:
    """A field, the site of a sensor, and the map that grows with its records.

    :param files: role and path of the files of field and site
    :param simulated: the counts come from a simulation; every output says so
    """

    field: Field
    site: sensing.Site
    map: FieldMap
    files: tuple[tuple[str, Path], ...] = ()
    simulated: bool = False
    earlier: tuple[EarlierRun, ...] = ()

    def __post_init__(self) -> None:
        self.map.curve_of = (lambda state: self.calibrated(state).curve) if lacks_n0(self.site) else None

    @cached_property
    def calibrated(self) -> Callable[[MapState], sensing.Site]:
        """The site with the calibration of a state; the last one is kept."""
        return lru_cache(maxsize=1)(self._calibrated)

    def _calibrated(self, state: MapState) -> sensing.Site:
        """The site; without N0 with the one that follows from median place, air pressure and mean rate of a
        state's records.

        So it depends on the records alone, and is the same on the robot, in a replay and of a log.
        """
        if not lacks_n0(self.site):
            return self.site
        f_pressure, _, x_m, y_m = state.medians
        corrected = self.site.corrections.pressure is not None
        hpa = self.site.corrections_parameters.pressure_hpa(f_pressure) if corrected else math.nan
        latitude, longitude = self.field.frame.to_geographic([[x_m, y_m]])[0].tolist()
        return with_general_calibration(
            self.site, sensing.SurveyAir(latitude, longitude, hpa), samples=state.samples
        )

    def health(self, state: MapState) -> list[Health]:
        """Health of a general calibration, with all that it assumes; empty for a site with its own N0."""
        if not lacks_n0(self.site):
            return []
        try:
            found = self.calibrated(state).calibration if state.records else None
        except ValueError as error:  # of an impossible air pressure
            return [Health("calibration", Level.ERROR, f"the general calibration fails: {error}")]
        if found is None:
            known = self.site.sensor_sensitivity is not None
            waits = "general, waits for the air pressure of the first record" if known else sensing.UNKNOWN_SENSOR
            return [Health("calibration", Level.OK, waits)]
        assumed = ", ".join(part.name for part in found.parts if part.origin == "default range")
        sd = (found.n0_sd_cps or 0.0) / found.n0_cps
        text = f"{found.note}; N0 {found.n0_cps:g} counts/s +- {sd:.1%}; default ranges, not measured: {assumed}"
        if found.method == sensing.UNKNOWN_SENSOR:
            remedy = "give sensor_sensitivity in the site file, such as the model"
            text = f"{found.note}; no dose follows from it: {remedy}; default ranges, not measured: {assumed}"
        values = {str(part.name): part.text for part in found.parts}
        return [Health("calibration", Level.OK, f"{text}; {_SNOW}", values)]

    def dose_basis(self, state: MapState) -> dict[str, Any] | None:
        """Basis of a dose besides the map, as JSON: site with its calibration, air of the records, and whether
        they are simulated or there are earlier surveys; ``None`` where the site has nothing on irrigation.
        """
        if "irrigation" not in self.site.model_fields_set or not state.records:
            return None
        site = self.calibrated(state).model_dump(
            mode="json", exclude_defaults=True, exclude={"calibration": {"parts"}}
        )
        if math.isfinite(self.site.shield_radius_m):  # given, even if it is the default
            site["footprint_radius_m"] = self.site.footprint_radius_m
        return {"site": site, "air": state.medians[:2], "simulated": self.simulated, "earlier": bool(self.earlier)}

    def run(self, snapshot: Snapshot) -> MapRun:
        """The run of a snapshot, for its outputs.

        :raises InputError: if there are too few samples for a map
        :raises IllConditionedError: as :meth:`FieldMap.compute`
        """
        require_other(self.earlier, snapshot.track)
        soil_map = self.map.compute(snapshot.state)
        if soil_map is None:
            raise InputError("there are too few samples for a map", "wait for more records")
        general = lacks_n0(self.site) and self.site.sensor_sensitivity is not None
        return make_run(
            soil_map, snapshot.track, self.calibrated(snapshot.state), self.field.frame,
            field_name=self.field.name, settings=settings_of(self.map, soil_map, self.map.merge_radius_m),
            inputs=[input_file(path, role) for role, path in self.files], losses=loss_rows_of(snapshot),
            simulated=self.simulated, covariates=self.map.knowledge.covariates, earlier=self.earlier,
            notes=[Note(NoteCode.GENERAL_CALIBRATION, f"{_SNOW.capitalize()}.")] if general else (),
        )  # fmt: skip


def settings_of(field_map: FieldMap, soil_map: SoilMap, merge_radius_m: float) -> dict[str, object]:
    """Settings of a map for the reader of its run."""
    settings = field_map.settings
    return {
        "variogram_model": settings.model, "variogram_fit": settings.fit, "poisson_noise": settings.noise,
        "local_variance": "off", "drift_model": settings.drift_model,
        "nugget": "kept" if settings.keep_nugget else "filtered", "merge_radius_m": merge_radius_m,
        "cell_m": field_map.grid.cell_m, "deconvolved_footprint_m": soil_map.deconvolved_m,
    }  # fmt: skip


def open_survey(
    field: str,
    site: str = "",
    *,
    simulated: bool = False,
    earlier: Sequence[Path | str] = (),
    property_name: str = "",
    covariates: Sequence[str] = (),
    recorded: Mapping[str, Any] | None = None,
    frame: LocalFrame | None = None,
    **chosen: Any,
) -> FieldSurvey:
    """A field survey without records.

    :param field: field file, or the name of a shipped one
    :param site: site file, or the name of a shipped one; empty for a rate map without a site
    :param earlier: earlier runs of the field, see :func:`read_earlier_runs`
    :param property_name: name of the property in them; empty for the robot's own
    :param covariates: files with covariates as FILE or FILE:BAND, in addition to those of the field
    :param recorded: parameters of the mapper whose map is opened again
    :param frame: plane of the map; ``None`` for that of the field file
    :param chosen: settings of :class:`MappingSettings`
    :raises InputError: if a file cannot be used or the field cannot be gridded
    """
    values = MappingSettings(**chosen).values(recorded)
    field_path = resource("fields", field)
    site_path = resource("sites", site) if site else None
    # Nothing says that counts without a site file are those of a neutron sensor over soil.
    the_field, the_site = (
        load_field(field_path), sensing.load_site(site_path) if site_path else sensing.Site(calibration=None),
    )  # fmt: skip
    the_field = the_field if frame is None else the_field.moved_to(frame)
    files = [("field", field_path), *([("site", site_path)] if site_path else [])]
    radius_m = the_site.footprint_radius_m
    grid = the_field.grid(values["cell_m"] or None, radius_m)
    later = the_site.corrections.pressure is not None  # each corrected record has a pressure
    opened = with_general_calibration(the_site, sensing.SurveyAir(*the_field.centre), later)
    values["merge_radius_m"] = values["merge_radius_m"] or None
    settings = field_map_settings(values, opened, margin_m=radius_m)
    target = EarlierTarget(the_field.frame, grid, settings, property_name, not property_name, simulated)
    sources = (*the_field.covariates, *map(CovariateSource.parse, covariates))
    files += [("covariate", path) for path in dict.fromkeys(one.path for one in sources)]
    the_map, runs = open_map(target, earlier, sources)
    return FieldSurvey(the_field, the_site, the_map, tuple(files), simulated, runs)


def lacks_n0(site: sensing.Site) -> bool:
    """True if a site has no N0, and does not ask for the rate alone."""
    return site.calibration is None and "calibration" not in site.model_fields_set


def with_general_calibration(
    site: sensing.Site, air: sensing.SurveyAir, later: bool = False, samples: Samples | None = None
) -> sensing.Site:
    """Site with the general calibration, where :func:`lacks_n0`; without a sensor with that of an unknown one.

    :param later: whether the air pressure may still come: until then the site stays as it is
    :param samples: the samples of its map, whose mean rate an unknown sensor needs: without it the site stays
    :raises InputError: if nothing says the air pressure, to which N0 is scaled, or the organic matter of peat
    """
    if not lacks_n0(site):
        return site
    if site.sensor_sensitivity is None:
        found = (
            None if samples is None or not len(samples) else sensing.unknown_sensor(site, air, mean_rate(samples))
        )
        return _with_soil(site, found)
    if why := sensing.why_no_soil(site):
        raise InputError(why, "add it to 'soil', or 'calibration: null' for the rate alone")
    found = sensing.general_calibration(site, air)
    if found is not None or later:
        return _with_soil(site, found)
    message = "the general calibration needs the air pressure, and neither the log nor the site file has it"
    raise InputError(message, "give 'altitude_m' in 'location', or 'calibration: null' for the rate alone")


def planning_curve(site: sensing.Site, field: Field, required: bool) -> sensing.MoistureCurve | None:
    """Curve by which a plan for moisture weighs places, before the first record; ``None`` without a calibration.

    The general calibration is that of the pressure to which counts are corrected: the true one hardly changes it.

    :raises InputError: if it is required: a plan of a guessed level would count longest at the wrong places
    """
    reference_hpa = site.corrections_parameters.reference_pressure_hpa
    air = sensing.SurveyAir(*field.centre, math.nan if site.corrections.pressure is None else reference_hpa)
    try:
        curve = with_general_calibration(site, air).curve
    except InputError:
        if required:
            raise
        return None
    if curve is not None or not required:
        return curve
    what = "the target is vwc, but there is no calibration, and the sensor is unknown"
    raise InputError(what, "give a site file with a calibration, or with sensor_sensitivity, such as the model")


def planning_thresholds(
    target: str, text: str | None, site: sensing.Site, curve: sensing.MoistureCurve | None
) -> Thresholds | None:
    """Thresholds of a decision, of the moisture where there is a curve; ``None`` for another target.

    :param text: thresholds, or ``dose`` for those of the site file
    :raises InputError: if there are none, or the moisture cannot have them
    """
    check_target(target, text)
    if not text:
        return None
    if text != OF_DOSE:
        return Thresholds.of(parse_thresholds(check_thresholds(text)), curve)
    if curve is None:
        raise InputError(
            "the threshold is dose, but there is no calibration", "give a site file with a calibration"
        )
    return Thresholds.of(site.irrigation.dose_thresholds, curve)


def _with_soil(site: sensing.Site, found: tuple[sensing.Calibration, sensing.Soil] | None) -> sensing.Site:
    """Site with a calibration and its soil, if there are any."""
    return site if found is None else site.model_copy(update={"calibration": found[0], "soil": found[1]})


def field_map_settings(values: Mapping[str, Any], site: sensing.Site, **more: Any) -> FieldMapSettings:
    """Settings of the map of a sensor."""
    return FieldMapSettings(
        **{name: value for name, value in values.items() if name != "cell_m"}, curve=site.curve,
        footprint_radius_m=site.known_footprint_m, deconvolve=site.deconvolve_footprint, **more,
    )  # fmt: skip


def open_map(
    target: EarlierTarget, earlier: Sequence[Path | str], covariates: Sequence[CovariateSource]
) -> tuple[FieldMap, tuple[EarlierRun, ...]]:
    """A map without records, and the earlier surveys that inform it, see :func:`read_earlier_runs`."""
    runs = read_earlier_runs(earlier, target) if earlier else ()
    explained = read_covariates(covariates, target.frame, target.grid)
    known = Knowledge(tuple(run.survey for run in runs), explained)
    return FieldMap(target.grid, target.settings, known), runs


def require_crs(crs: str | None, frame: LocalFrame | None = None) -> None:
    """Check a coordinate reference system before the work.

    :param crs: anything that pyproj accepts; ``None`` for the default
    :param frame: plane of the field; ``None`` if it is not known yet
    :raises InputError: if pyproj does not know it, it has no plane or longitudes, or it is for another region
    """
    if crs is None:
        return
    target = (frame or LocalFrame(0.0, 0.0)).export_crs(crs)
    if not (target.is_projected or target.is_geographic):
        raise InputError(f"'{crs}' ({target.name}) is not a projection", "give an EPSG code, e.g. EPSG:25832")
    area = target.area_of_use
    if frame is None or area is None:
        return
    east = (frame.longitude_deg - area.west) % 360 - (area.east - area.west) % 360
    beyond_east_deg = min(max(east, 0.0), (area.west - frame.longitude_deg) % 360)
    beyond_deg = max(area.south - frame.latitude_deg, frame.latitude_deg - area.north, beyond_east_deg)
    if (area.east - area.west) % 360 and beyond_deg > MAX_BEYOND_AREA_DEG:
        message = (
            f"'{crs}' ({target.name}) is for {area.name.split(' - ')[0]}, {beyond_deg:.0f} deg from the field"
        )
        raise InputError(message, "choose one for this region, or none for the UTM zone of the field")


def make_run(
    soil_map: SoilMap,
    records: Sequence[sensing.CountRecord],
    site: sensing.Site,
    frame: LocalFrame,
    *,
    title: str | None = None,
    earlier: Sequence[EarlierRun] = (),
    **about: Any,
) -> MapRun:
    """The run behind a map, made now.

    :param records: records in order of time, at least one good one; includes records without a place, and
        quarantined ones
    :param site: site of the sensor; the records have its corrections
    :param title: title of the report; ``None`` derives it from what is mapped
    :param about: other fields of :class:`MapRun`
    """
    track = [record for record in records if not record.quarantine]
    rows = _correction_rows(track, site)
    earlier = [with_corrections(one, {row.name: row.parameters for row in rows}) for one in earlier]
    stamp_s = max((record.stamp_s for record in track), default=0.0)
    return MapRun(
        soil_map=soil_map, frame=frame, created_utc=datetime.now(UTC), track=track,
        title=title or ("Soil moisture map" if site.curve else "Neutron count rate map"), site=site.name,
        corrections=rows, version=__version__, **_footprint(track, site, bool(about.get("simulated"))),
        quarantined=[record for record in records if record.quarantine], **site_facts(site),
        time_zone=site.time_zone or "", sensed=_sensed_soil(soil_map, track, site), earlier=earlier,
        change=run_change(soil_map, stamp_s, earlier), **about,
    )  # fmt: skip


def input_file(path: Path, role: str, n_records: int | None = None) -> InputFile:
    """An input file of a run, with its size and checksum."""
    content = path.read_bytes()
    return InputFile(shown_path(path), n_records, len(content), hashlib.sha256(content).hexdigest(), role)


def _correction_rows(records: Sequence[sensing.CountRecord], site: sensing.Site) -> list[CorrectionRow]:
    """The corrections of pressure, humidity and intensity, then the constant factors of the site file."""
    settings, used = site.corrections, site.corrections_parameters
    pressure, humidity, intensity = settings.pressure, settings.humidity, settings.intensity
    of_pressure: dict[str, float | str] = {}
    if pressure is not None:
        of_pressure["beta [1/hPa]"] = round(used.beta_per_hpa, 6)
        of_pressure["P0 [hPa]"] = round(used.reference_pressure_hpa, 2)
    universal = site.humidity_method == "universal"
    of_humidity: dict[str, float | str] = {}
    if humidity is not None:
        of_humidity = {} if universal else {"c [m3/g]": humidity.coefficient_m3g}
        of_humidity["Q0 [g/m3]"] = humidity.reference_gm3
        of_humidity |= {"at moisture [m3/m3]": settings.typical_vwc} if universal else {}
    of_intensity: dict[str, float | str] = {} if intensity is None else {"C0": intensity.reference}
    if intensity is not None and intensity.scaling != "none":
        of_intensity["k"] = round(used.intensity_scale, 4)
    h_formula = "N(Q0) / N(Q), universal transport solution" if universal else "1 + c (Q - Q0)"
    i_formula = "C0 / C" if used.intensity_scale == 1 else "1 / (1 + k (C / C0 - 1))"
    i_source = _intensity_source(settings, intensity, records) if intensity else ""
    found = []
    for name, how, factor, parameters, remark in (
        ("air pressure", "exp(beta (P - P0))", "f_pressure", of_pressure, _from_the_place(site)),
        ("air humidity", h_formula, "f_humidity", of_humidity, ""),
        ("incoming neutrons", i_formula, "f_intensity", of_intensity, i_source),
    ):
        spread = _range([getattr(record, factor) for record in records])
        found.append(CorrectionRow(name, how, parameters, *spread, remark if parameters else "not applied"))
    if settings.biomass is not None:
        biomass, share = settings.biomass.used
        plants = {"B [kg/m2]": round(biomass, 3), "b [m2/kg]": round(share, 5)}
        found.append(CorrectionRow("plants", "1 / (1 - b B)", plants, *_range([settings.f_biomass]), "constant"))
    if settings.road is not None:
        road = {
            "width [m]": settings.road.width_m, "distance [m]": settings.road.distance_m,
            "road [m3/m3]": settings.road.vwc, "field [m3/m3]": settings.typical_vwc,
        }  # fmt: skip
        found.append(CorrectionRow("road", "1 / (1 + F1 F2 F3)", road, *_range([settings.f_road]), "constant"))
    return found


def _mean_air(track: Sequence[sensing.CountRecord], site: sensing.Site) -> tuple[float, float]:
    """Absolute humidity [g/m^3] and air pressure [hPa] of a survey, by the mean factors of its records."""
    used = site.corrections_parameters
    factors = (float(np.mean([getattr(one, name) for one in track])) for name in ("f_humidity", "f_pressure"))
    return used.humidity_gm3(next(factors)), used.pressure_hpa(next(factors))


def _footprint(track: Sequence[sensing.CountRecord], site: sensing.Site, simulated: bool) -> dict[str, Any]:
    """Radius that the site file gives; else the default of a bare probe with its range."""
    if simulated or math.isfinite(site.shield_radius_m) or not track:
        return {"footprint_radius_m": site.footprint_radius_m}
    low, usual, high = sensing.bare_radius_m(*_mean_air(track, site), site.vegetation_height_m)
    return {"footprint_radius_m": usual, "footprint_range_m": (low, high)}


def _sensed_soil(
    soil_map: SoilMap, track: Sequence[sensing.CountRecord], site: sensing.Site
) -> sensing.SensedSoil | None:
    """Depth and radius that the counts of a moisture map come from, in the mean air of the survey."""
    curve = soil_map.curve
    if curve is None or not track:
        return None
    air = sensing.Footprint(0.0, *_mean_air(track, site), site.vegetation_height_m, site.shield_radius_m)
    vwc = soil_map.vwc[soil_map.grid.mask]
    return sensing.sensed_soil(vwc, curve.bulk_density_gcm3, curve.lattice_water + curve.organic_water, air)


def _from_the_place(site: sensing.Site) -> str:
    """Values of the pressure correction that follow from the place; empty if there are none."""
    pressure, cosmic = site.corrections.pressure, site.corrections.cosmic(site.location)
    if pressure is None or cosmic is None or None not in (pressure.beta_per_hpa, pressure.reference_hpa):
        return ""
    names = ["beta"] * (pressure.beta_per_hpa is None) + ["P0"] * (pressure.reference_hpa is None)
    return (
        f"{' and '.join(names)} from the place ({cosmic.cutoff_rigidity_gv:.2f} GV, {cosmic.depth_gcm2:.0f} g/cm2)"
    )


def _intensity_source(
    settings: sensing.CorrectionSettings,
    intensity: sensing.IntensityCorrection,
    records: Sequence[sensing.CountRecord],
) -> str:
    monitor = f" of {intensity.monitor}" if intensity.monitor else ""
    scaling = "" if intensity.scaling == "none" else f", scaled as in {intensity.scaling}"
    text = f"C{monitor} from {intensity.file.name if intensity.file else 'a constant'}{scaling}"
    try:
        series = sensing.intensity_source(settings)
    except InputError:  # the file of a recorded run may be elsewhere
        return text
    if not isinstance(series, sensing.NeutronMonitor):
        return text
    if not monitor and series.station:
        text = text.replace("C from", f"C of {series.station} from", 1)
    gap_s = series.longest_gap_s(records[0].stamp_s, records[-1].stamp_s)
    return f"{text}; gaps up to {gap_s / 3600:.1f} h interpolated" if gap_s > 0 else text


def _range(factors: Sequence[float]) -> tuple[float, float, float]:
    return float(np.mean(factors)), min(factors), max(factors)


def site_facts(site: sensing.Site) -> dict[str, Any]:
    """Fields ``calibration`` and ``irrigation`` of a :class:`MapRun`, by the site of the run."""
    return {"calibration": _calibration(site), "irrigation": site.irrigation}


def _calibration(site: sensing.Site) -> CalibrationInfo | None:
    if site.calibration is None or site.soil is None:
        return None
    source = ", ".join(filter(None, [site.calibration.date, site.calibration.note]))
    of_soil = {part.name: part for part in sensing.soil_of(site)[1]}
    told = [part for part in site.calibration.parts if _is_so(part, of_soil.get(part.name))]
    added = {part.name for part in told}
    return CalibrationInfo(
        n0_cps=site.calibration.n0_cps, bulk_density_gcm3=site.soil.bulk_density_gcm3,
        n0_sd_cps=site.calibration.n0_sd_cps, lattice_water=site.soil.lattice_water,
        organic_water=site.soil.organic_water, source=source, illustrative=site.calibration.illustrative,
        method=site.calibration.method, reference_hpa=site.calibration.reference_hpa,
        parts=(*told, *(part for name, part in of_soil.items() if name not in added)),
    )  # fmt: skip


def _is_so(part: sensing.UncertaintyPart, now: sensing.UncertaintyPart | None) -> bool:
    """False for a part of the soil whose value or standard deviation is another one now."""
    return now is None or np.allclose([part.value, part.sd], [now.value, now.sd], rtol=1e-3)


def loss_rows_of(snapshot: Snapshot) -> list[LossRow]:
    """Rows of records left out of a map, one a reason: lost records first, then records quarantined elsewhere."""
    last = {
        one.quarantine: one for one in snapshot.track if one.quarantine not in ("", sensing.Kind.UNEXPECTED_COUNT)
    }
    counts = Counter(record.quarantine for record in snapshot.track)
    rows = []
    for reason, entry in snapshot.skipped.items():
        if reason is not Skip.QUARANTINED:
            consequence: sensing.Consequence = "quarantined" if reason is Skip.UNEXPECTED else "lost"
            rows.append(LossRow(reason.value, entry.count, entry.example, consequence, reason.remedy))
    remedy = Skip.QUARANTINED.remedy
    for code, record in last.items():
        rows.append(LossRow(sensing.reason_text(code), counts[code], str(record), "quarantined", remedy))
    return rows
