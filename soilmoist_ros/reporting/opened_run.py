# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A finished run, opened from its folder."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import Visit, VisitEnd
from soilmoist_ros.foundation import InputError, Mistake, text_of_csv
from soilmoist_ros.mapping import opened_raster
from soilmoist_ros.pipeline import REMEDY, read_features, read_summary
from soilmoist_ros.recording import COLUMNS, SUMMARY, read_records

if TYPE_CHECKING:
    from pyproj import CRS

Columns = dict[str, NDArray[Any]]
Row = TypeVar("Row")


@dataclass(frozen=True)
class OpenedRun:
    """A run folder of ``map``, ``simulate``, ``replay`` or ``demo``. Files are read on first use.

    ``name`` is that of a property, empty for the first. What is missing or damaged raises an :class:`InputError`.
    """

    folder: Path

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Content of ``summary.json``."""
        return read_summary(self.folder)

    @property
    def properties(self) -> list[str]:
        """Names of the mapped properties; the first is ``""``, the one in ``map.tif``."""
        names = [path.stem.removeprefix("map_") for path in sorted(self.folder.glob("map_*.tif"))]
        return ([""] if (self.folder / "map.tif").is_file() else []) + names

    def samples(self, name: str = "") -> Columns:
        """The merged samples of a property: longitude and latitude [deg], counts, exposure, rate and moisture.

        :returns: one array of shape (n,) for each column; undefined values are NaN
        """
        found = [feature for feature in self.features(name) if feature["properties"].get("kind") == "sample"]
        try:
            places = np.array([feature["geometry"]["coordinates"][:2] for feature in found], float).reshape(-1, 2)
            columns: Columns = {"longitude_deg": places[:, 0], "latitude_deg": places[:, 1]}
            for key in found[0]["properties"] if found else ():
                if key not in ("kind", "calibrated"):
                    columns[key] = np.array([feature["properties"][key] for feature in found], float)
                    columns[key].shape = (len(found),)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            file = self._file("samples", name, "geojson")
            raise InputError(f"has a damaged sample: {error!s:.200}", REMEDY, file) from None
        return columns

    def features(self, name: str = "") -> list[dict[str, Any]]:
        """All features of ``samples.geojson`` of a property: field, no-go areas, tracks, samples."""
        return read_features(self._file("samples", name, "geojson"))

    def records(self, name: str = "") -> Columns:
        """Columns of ``records.csv`` of a property, the fields of :class:`CountRecord`; empty in older folders."""
        path = self.folder / f"records{f'_{name}' if name else ''}.csv"
        if not path.is_file():
            return {}
        found = read_records(path)
        return {column: np.array([getattr(record, column) for record in found]) for column in COLUMNS}

    @cached_property
    def series(self) -> Columns:
        """Columns of ``series.csv``, each of shape (n,); empty without a mission."""
        rows = _rows(
            self.folder / "series.csv", lambda row: {name: float(text or "nan") for name, text in row.items()}
        )
        return {name: np.array([row[name] for row in rows]) for name in (rows[0] if rows else ())}

    @cached_property
    def visits(self) -> list[Visit]:
        """The visits in order; empty without a mission. Older files get the defaults of :class:`Visit`."""
        return _rows(self.folder / "visits.csv", _visit)

    def bands(self, name: str = "") -> Columns:
        """The map of a property by the names of its bands, of shape (rows, columns), north up, NaN outside."""
        return self.raster(name)[0]

    def _file(self, kind: str, name: str, ending: str) -> Path:
        path = self.folder / f"{kind}{f'_{name}' if name else ''}.{ending}"
        if not path.is_file():
            known = ", ".join(repr(one) for one in self.properties) or "none"
            raise InputError(f"there is no {path.name}", f"the properties with a map are: {known}", self.folder)
        return path

    def raster(self, name: str = "") -> tuple[Columns, Any, CRS, dict[str, str]]:
        """Bands of the map of a property by name, affine transform, coordinate reference system and tags.

        :raises InputError: if there is no such map
        """
        from pyproj import CRS

        with opened_raster(self._file("map", name, "tif"), REMEDY) as raster:
            values = raster.read(masked=True).filled(np.nan)
            names = [text or f"band_{n}" for n, text in enumerate(raster.descriptions, start=1)]
            bands, crs = dict(zip(names, values, strict=True)), CRS.from_user_input(raster.crs)
            return bands, raster.transform, crs, dict(raster.tags())


def open_run(folder: Path | str) -> OpenedRun:
    """Open the output folder of ``map``, ``simulate``, ``replay`` or ``demo``.

    :raises InputError: if ``summary.json`` is missing or damaged

    >>> import tempfile
    >>> from soilmoist_ros.reporting import write_mission
    >>> from soilmoist_ros.simulation import MissionSettings, simulate_mission
    >>> result = simulate_mission(MissionSettings(hours=0.3, cell_m=8.0, dwell="fmi:60", preset="paper"))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = write_mission(Path(folder), result)
    ...     run = open_run(folder)
    ...     len(run.visits) == len(result.visits), sorted(run.bands())
    (True, ['rate', 'rate_sd', 'vwc', 'vwc_p05', 'vwc_p95', 'vwc_sd'])
    """
    run = OpenedRun(Path(folder))
    if run.folder.is_file():
        raise InputError("is a file, not the folder of a run", f"give {run.folder.parent}", run.folder)
    if not (run.folder / SUMMARY).is_file():
        raise InputError(f"holds no {SUMMARY}", "give the folder that --out of a run named", run.folder)
    _ = run.summary
    return run


def _rows(path: Path, read: Callable[[dict[str, str]], Row]) -> list[Row]:
    """Values read from each row of a CSV file; empty if the file does not exist."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as stream:
        table = csv.DictReader(stream)
        try:
            return list(map(read, table))
        except (ValueError, TypeError, csv.Error) as error:  # TypeError: more or fewer cells than columns
            mistake = Mistake(f"cannot be read: {error!s:.200}", REMEDY, path, table.line_num)
            raise InputError([mistake]) from None


def _visit(row: dict[str, str]) -> Visit:
    kinds = {"int": int, "float": float, "str": str, "VisitEnd": VisitEnd}
    values: dict[str, Any] = {}
    for field in fields(Visit):
        text = text_of_csv(row.get(field.name) or "")
        if text or field.default is MISSING:
            values[field.name] = kinds[str(field.type)](text or "nan" if field.type == "float" else text)
    return Visit(**values)
