# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A map that grows, opened from the files of a field and a site, and saved as an output folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from soilmoist_ros.foundation import InputError, resource
from soilmoist_ros.mapping import (
    CovariateSource,
    Drift,
    DriftModel,
    Field,
    FieldMap,
    FieldMapSettings,
    FitMethod,
    Knowledge,
    LocalModel,
    ModelName,
    NoiseModel,
    Snapshot,
    load_field,
    read_covariates,
)
from soilmoist_ros.reporting.earlier.earlier_runs import EarlierRun, Target, read_earlier_runs, require_other
from soilmoist_ros.sensing import Site, load_site

if TYPE_CHECKING:
    from soilmoist_ros.reporting.run import MapRun


@dataclass(frozen=True)
class FieldSurvey:
    """A field, the site of a sensor, and the map that grows with its records.

    :param field: the field
    :param site: the sensor and its soil
    :param map: map that grows with the records
    :param files: role and path of the files of field and site
    :param simulated: the counts come from a simulation; every output says so
    :param earlier: earlier surveys that inform the map
    """

    field: Field
    site: Site
    map: FieldMap
    files: tuple[tuple[str, Path], ...] = ()
    simulated: bool = False
    earlier: tuple[EarlierRun, ...] = ()

    def with_reference_error(self, error: Drift) -> FieldSurvey:
        """The same, without records, for records that a reference sensor corrects."""
        knowledge = replace(self.map.knowledge, reference=error)
        return replace(self, map=FieldMap(self.map.grid, self.map.settings, knowledge))

    def run(self, snapshot: Snapshot) -> MapRun:
        """The run of a snapshot, for its outputs.

        :raises InputError: if there are too few samples for a map
        :raises IllConditionedError: as :meth:`FieldMap.compute`
        """
        from soilmoist_ros.reporting.map_run import input_file, loss_rows_of, make_run

        require_other(self.earlier, snapshot.track)
        soil_map = self.map.compute(snapshot.state)
        if soil_map is None:
            raise InputError("there are too few samples for a map", "wait for more records")
        settings = self.map.settings
        return make_run(
            soil_map,
            snapshot.track,
            self.site,
            self.field.frame,
            field_name=self.field.name,
            settings={
                "variogram_model": settings.model,
                "variogram_fit": settings.fit,
                "poisson_noise": settings.noise,
                "nugget": "kept" if settings.keep_nugget else "filtered",
                "merge_radius_m": self.map.merge_radius_m,
                "cell_m": self.map.grid.cell_m,
                "deconvolved_footprint_m": soil_map.deconvolved_m,
            },
            inputs=[input_file(path, role) for role, path in self.files],
            losses=loss_rows_of(snapshot),
            simulated=self.simulated,
            covariates=self.map.knowledge.covariates,
            earlier=self.earlier,
        )

    def save(self, folder: Path, snapshot: Snapshot) -> list[Path]:
        """Write the output folder of a snapshot.

        :param folder: output folder; made if missing
        :returns: the files
        :raises InputError: as :meth:`run`, or if the folder cannot be written
        :raises IllConditionedError: as :meth:`run`
        """
        from soilmoist_ros.reporting.outputs import write_outputs

        return write_outputs(folder, self.run(snapshot))


def open_survey(
    field: str,
    site: str = "",
    *,
    cell_m: float = 0.0,
    model: ModelName = "matern32",
    fit: FitMethod = "reml",
    noise: NoiseModel = "local",
    local: LocalModel = "auto",
    drift_model: DriftModel = "auto",
    keep_nugget: bool = True,
    merge_radius_m: float = 0.0,
    simulated: bool = False,
    earlier: Sequence[Path | str] = (),
    property_name: str = "",
    covariates: Sequence[str] = (),
) -> FieldSurvey:
    """A field survey without records.

    :param field: field file, or the name of a shipped one
    :param site: site file, or the name of a shipped one; empty for a rate map without a site
    :param cell_m: cell size of the map [m]; 0 for the field's own, or one chosen from its extent
    :param merge_radius_m: records closer together than this become one sample [m]; 0 for a radius chosen from
        the footprint and the extent of the field
    :param simulated: the counts come from a simulation
    :param earlier: earlier runs of the field, see :func:`read_earlier_runs`
    :param property_name: name of the property in them; empty for the robot's own
    :param covariates: files with covariates as FILE or FILE:BAND, in addition to those of the field

    The other parameters are those of :class:`FieldMapSettings`.

    :raises InputError: if a file cannot be used or the field cannot be gridded
    """
    field_path = resource("fields", field)
    the_field = load_field(field_path)
    files = [("field", field_path)]
    the_site = Site()
    if site:
        site_path = resource("sites", site)
        the_site = load_site(site_path)
        files.append(("site", site_path))
    grid = the_field.grid(cell_m or None, the_site.footprint_radius_m)
    settings = FieldMapSettings(
        model,
        fit,
        keep_nugget,
        merge_radius_m or None,
        the_site.footprint_radius_m,
        the_site.curve,
        the_site.known_footprint_m,
        noise=noise,
        local=local,
        drift_model=drift_model,
        deconvolve=the_site.deconvolve_footprint,
    )
    runs: tuple[EarlierRun, ...] = ()
    if earlier:
        target = Target(the_field.frame, grid, settings, property_name, not property_name, simulated)
        runs = read_earlier_runs(earlier, target)
    sources = (*the_field.covariates, *map(CovariateSource.parse, covariates))
    files += [("covariate", path) for path in dict.fromkeys(one.path for one in sources)]
    knowledge = Knowledge(tuple(run.survey for run in runs), read_covariates(sources, the_field.frame, grid))
    the_map = FieldMap(grid, settings, knowledge)
    return FieldSurvey(the_field, the_site, the_map, tuple(files), simulated, runs)
