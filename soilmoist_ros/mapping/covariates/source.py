# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where covariates come from: a file, a part of it, and what is derived from elevations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

from soilmoist_ros.foundation import InputError, Section

Derived = Literal["elevation", "slope", "aspect", "northness", "eastness", "curvature", "wetness"]
DERIVED: tuple[Derived, ...] = get_args(Derived)
"""What can be made of elevations; ``elevation`` is the band itself, ``aspect`` northness and eastness."""


@dataclass(frozen=True)
class CovariateSource:
    """A file with covariates.

    :param path: a raster in any reference system, or a vector file with polygons
    :param band: number (from 1) or name of the raster's band, something that is derived from elevations if no band
        has this name, or the attribute of the polygons; empty for the first band, or the only attribute
    :param derive: what is made of elevations; empty for the values themselves
    :param name: how reports name it; empty for the name of the file
    """

    path: Path
    band: str = ""
    derive: tuple[Derived, ...] = ()
    name: str = ""

    @classmethod
    def parse(cls, text: str, folder: Path = Path()) -> CovariateSource:
        """Read ``FILE`` or ``FILE:BAND``.

        >>> CovariateSource.parse("relief.tif:slope").band
        'slope'

        :param folder: where relative paths start
        """
        file, _, band = text.rpartition(":")
        if not file or (folder / text).exists() or "/" in band or "\\" in band:
            file, band = text, ""
        return cls(folder / Path(file).expanduser(), band)

    def require_file(self) -> None:
        """Check that the file is there.

        :raises InputError: if it is not
        """
        if not self.path.is_file():
            raise InputError("there is no such file of covariates", "check its path", self.path)

    @property
    def label(self) -> str:
        """Name for readers."""
        return self.name or self.path.stem

    @property
    def section(self) -> dict[str, object]:
        """The source in a field file of any folder, without what is left out."""
        keys = {"band": self.band, "derive": list(self.derive), "name": self.name}
        return {"file": str(self.path.absolute()), **{key: value for key, value in keys.items() if value}}

    @property
    def absolute(self) -> CovariateSource:
        """The source with an absolute path."""
        return replace(self, path=self.path.absolute())

    def __str__(self) -> str:
        return f"{self.path}:{self.band}" if self.band else str(self.path)


class CovariateSection(Section):
    """A file with covariates, in a field file."""

    file: Path
    """GeoTIFF, or GeoJSON or GeoPackage with polygons, in any reference system; relative to the field file."""
    band: str | int = ""
    """Number or name of the band, or attribute of the polygons; by default the first, or the only one."""
    derive: tuple[Derived, ...] = ()
    """What is made of elevations in metres; ``elevation`` for themselves."""
    name: str = ""
    """Name in reports; by default that of the file."""

    def source(self, folder: Path) -> CovariateSource:
        """The source, with its path from the folder of the field file."""
        return CovariateSource(folder / self.file, str(self.band), self.derive, self.name)
