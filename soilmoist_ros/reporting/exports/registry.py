# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Exports by name: built-in ones, and ones from other packages."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from filecmp import cmp
from pathlib import Path
from typing import Any

from soilmoist_ros.foundation import InputError, Registry
from soilmoist_ros.mapping import FarmPrior
from soilmoist_ros.recording import SUMMARY
from soilmoist_ros.reporting.exports.irrigation import write_dose
from soilmoist_ros.reporting.exports.isoxml import write_isoxml
from soilmoist_ros.reporting.exports.layers import write_zones
from soilmoist_ros.reporting.exports.qgis import write_geopackage, write_qgis
from soilmoist_ros.reporting.exports.sheet import write_sheet
from soilmoist_ros.reporting.exports.source import ExportSettings, RunSource, open_source
from soilmoist_ros.reporting.opened_run import open_run
from soilmoist_ros.reporting.output_folder import replaced_together

Write = Callable[[RunSource, Path, ExportSettings], list[Path]]


def write_prior(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write the six numbers of a survey that inform those of other fields; ``InputError`` without a fit."""
    path = folder / f"{source.run.folder.absolute().name}_prior.csv"
    path.write_text(FarmPrior.read(source.run.folder).table())
    return [path]


@dataclass(frozen=True)
class Export:
    """A form in which a run can be exported.

    :param write: writes the files of all properties into a folder and returns their paths
    :param label: name for readers
    :param description: who needs it, in a sentence
    :param suffix: end of the names of its files, such as ``.gpkg``
    """

    write: Write
    label: str
    description: str
    suffix: str


BUILT_IN = {
    "qgis": Export(
        write_qgis, "QGIS project", "everything in one project with styles; double-click soilmoist.qgz", ".qgz",
    ),
    "gpkg": Export(
        write_geopackage, "GeoPackage",
        "field, no-go areas, samples, records, track, visits and zones for any GIS", ".gpkg",
    ),
    "zones": Export(
        write_zones, "management zones",
        "polygons with area, mean moisture and water, for variable-rate terminals (zipped shapefile)", ".zip",
    ),
    "dose": Export(
        write_dose, "irrigation zones",
        "polygons of one dose with a rate column, for variable-rate terminals (shapefile and GeoJSON)", ".zip",
    ),
    "isoxml": Export(
        write_isoxml, "ISOXML task",
        "an irrigation task for ISOBUS terminals: ISO 11783-10 TASKDATA in a zip", ".zip",
    ),
    "sheet": Export(
        write_sheet, "irrigation sheet",
        "one page to print: where to irrigate how much, and how sure that is", ".pdf",
    ),
    "prior": Export(
        write_prior, "prior of the farm",
        "what the survey says of the variogram, for --prior of a survey of another field (CSV)", ".csv",
    ),
}  # fmt: skip


def _checked(plug_in: Any) -> Export:
    """An export of another package."""
    if not isinstance(plug_in, Export):
        raise TypeError("an export must be a soilmoist_ros.reporting.Export")
    return plug_in


EXPORTS: Registry[Export] = Registry("soilmoist_ros.exports", "export", BUILT_IN, _checked)
"""Exports by name; another package adds one with an entry point ``soilmoist_ros.exports``."""


def _written(name: str, paths: object) -> list[Path]:
    """The paths that an export returned, which may be a plug-in's."""
    if isinstance(paths, list | tuple) and all(isinstance(path, Path) and path.is_file() for path in paths):
        return list(paths)
    what = f"write must return a list of the paths written; it returned {paths!r}"
    raise InputError(f"export {name!r}: {what}", "correct the plug-in")


def export_run(
    run: Path | str,
    names: Iterable[str],
    folder: Path | None = None,
    settings: ExportSettings | None = None,
    note: Callable[[str], None] = lambda text: None,
    overwrite: bool = True,
    refused: list[str] | None = None,
) -> list[Path]:
    """Export a run into files for other programs.

    :param run: output folder of ``map``, ``simulate``, ``replay`` or ``demo``
    :param names: names of exports, see :data:`EXPORTS`
    :param folder: folder for the files; made if missing; by default ``export`` in the folder of the run
    :param note: is called with what the user should know, such as what the run lacks
    :param overwrite: whether files of earlier exports that differ may be replaced
    :param refused: gets the name of each export that the run does not allow, and the reason, while others are
        written; without a list, the first of them is an error
    :raises InputError: for an unknown name, a run without a map, exports that are all refused, a missing library,
        or a folder that cannot be written, holds another run, or has files that must not be replaced
    """
    kinds = {name: EXPORTS.get(name) for name in names}
    if not kinds:
        raise InputError("no export is given", f"use one of: {', '.join(EXPORTS.names())}")
    source = open_source(open_run(run))
    target = folder or source.run.folder / "export"
    if (target / SUMMARY).is_file() and not target.samefile(source.run.folder):
        raise InputError("holds another run", "choose another folder for the exports", target)
    written, failed = list[str](), list[InputError]()
    with replaced_together(target, written, whole=False) as workshop:
        for name, kind in kinds.items():
            try:
                paths = _written(name, kind.write(source, workshop, settings or ExportSettings()))
                written += [path.name for path in paths if path.name not in written]
            except InputError as error:
                failed.append(error)
                if refused is None or len(failed) == len(kinds):
                    raise InputError([mistake for one in failed for mistake in one.mistakes]) from None
                refused.append(f"{name}: {error}")
        there = [name for name in written if (target / name).exists()]
        held = [name for name in there if not cmp(workshop / name, target / name, shallow=False)]
        if held and not overwrite:
            message = f"has {', '.join(held)} of an earlier export"
            raise InputError(message, "choose another folder, or give --overwrite to replace them", target)
    for text in dict.fromkeys(source.notes):
        note(text)
    return [target / name for name in written]
