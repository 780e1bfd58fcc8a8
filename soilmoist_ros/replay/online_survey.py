"""The on-line map around its core: from names of files to a map, from a map to the output folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from soilmoist_ros.foundation.configuration import resource
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.field import Field, load_field
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings, Snapshot
from soilmoist_ros.mapping.variogram.fit import FitMethod
from soilmoist_ros.mapping.variogram.model import ModelName
from soilmoist_ros.recording.journal import ENTRIES, load_journal
from soilmoist_ros.recording.record_table import read_records, write_records
from soilmoist_ros.sensing.moisture.site import Site, load_site
from soilmoist_ros.sensing.records import CountRecord

if TYPE_CHECKING:
    from soilmoist_ros.reporting.run import MapRun

RECORDS = "records.csv"
"""Name of the table of records in an output folder, from which a later map can start."""


@dataclass(frozen=True)
class OnlineSurvey:
    """Field, site and choices of an on-line map.

    :param field: the field
    :param site: the sensor and its soil
    :param online: takes the records
    :param files: role and path of the files behind it
    :param simulated: the counts come from a simulation; every output says so
    """

    field: Field
    site: Site
    online: FieldMap
    files: tuple[tuple[str, Path], ...] = ()
    simulated: bool = False

    def run(self, snapshot: Snapshot) -> MapRun:
        """The map of a snapshot, and all that the outputs tell of it.

        :raises InputError: if there are not samples enough for a map
        :raises IllConditionedError: as :meth:`FieldMap.compute`
        """
        from soilmoist_ros.reporting.map_run import input_file, make_run
        from soilmoist_ros.reporting.run import LossRow

        soil_map = self.online.compute(snapshot.state)
        if soil_map is None:
            raise InputError("there are not samples enough for a map", "wait for more records")
        settings = self.online.settings
        return make_run(
            soil_map,
            snapshot.track,
            self.site,
            self.field.frame,
            field_name=self.field.name,
            settings={
                "variogram_model": settings.model,
                "variogram_fit": settings.fit,
                "nugget": "kept" if settings.keep_nugget else "filtered",
                "merge_radius_m": self.online.merge_radius_m,
                "cell_m": self.online.grid.cell_m,
                "deconvolved_footprint_m": settings.footprint_radius_m,
            },
            inputs=[input_file(path, role) for role, path in self.files],
            losses=[
                LossRow(reason.value, entry.count, entry.example, "lost", reason.remedy)
                for reason, entry in snapshot.skipped.items()
            ],
            simulated=self.simulated,
        )

    def save(self, folder: Path, snapshot: Snapshot) -> list[Path]:
        """Write the output folder of a snapshot, with the table of its records.

        :param folder: output folder; made if missing
        :returns: the files
        :raises InputError: as :meth:`run`, or if the folder cannot be written
        :raises IllConditionedError: as :meth:`run`
        """
        from soilmoist_ros.reporting.outputs import write_outputs

        written = write_outputs(folder, self.run(snapshot))
        write_records(folder / RECORDS, snapshot.track)
        return [*written, folder / RECORDS]


def open_survey(
    field: str,
    site: str = "",
    *,
    cell_m: float = 0.0,
    model: ModelName = "matern32",
    fit: FitMethod = "reml",
    keep_nugget: bool = True,
    merge_radius_m: float = 0.0,
    simulated: bool = False,
) -> OnlineSurvey:
    """An on-line map without records.

    :param field: field file, or the name of a shipped one
    :param site: site file, or the name of a shipped one; empty for none, then there is a rate map only
    :param cell_m: cell size of the map [m]; 0 for the field's own, or one chosen from its extent
    :param merge_radius_m: records closer together than this become one sample [m]; 0 for a radius chosen from
        the footprint and the extent of the field
    :param simulated: the counts come from a simulation

    The others are those of :class:`FieldMapSettings`.

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
        the_site.support_radius_m,
    )
    return OnlineSurvey(the_field, the_site, FieldMap(grid, settings), tuple(files), simulated)


def read_earlier(path: Path, name: str = "") -> list[CountRecord]:
    """Records to start from.

    :param path: a folder that :meth:`OnlineSurvey.save` has written, a bag with ``counts``, or the journal of a
        mission: then the records of the mission that was interrupted, none if it had ended
    :param name: of the further property whose records are wanted from a journal or bag, as the planner knows it;
        empty for those of the first
    :raises InputError: if it is none of these
    """
    if (path / ENTRIES).is_file():
        from soilmoist_ros.exploration.mission.journal import interrupted_records

        found = load_journal(path, whole=True)
        return interrupted_records(found.snapshot, (entry.payload for entry in found.entries), name)
    if (path / RECORDS).is_file():
        return read_records(path / RECORDS)
    if path.is_dir() and not any(path.glob("*.mcap")) and not (path / "metadata.yaml").is_file():
        raise InputError(
            f"holds neither {RECORDS} nor a bag nor a journal",
            "give a folder that the mapper has saved, a bag, or the journal of a mission",
            path,
        )
    from soilmoist_ros.recording.bag.reader import BagReader

    with BagReader(path) as bag:
        if not name:
            return bag.read_counts()
        ending = f"/{name.strip('/')}/counts"
        return bag.read_counts(next((topic for topic in sorted(bag.topics) if topic.endswith(ending)), ending))
