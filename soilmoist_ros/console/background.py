# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The background of the map: an orthophoto as a picture in the plane of the field.

Run as a module, it reads ``{"source", "datum", "boundary"}`` as JSON, and prints picture and extent, or
``{"error": ...}``.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import logging
import resource
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.console.board import Board
from soilmoist_ros.console.runs import Jobs
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import RasterBands, opened_raster

if TYPE_CHECKING:
    from rasterio.io import DatasetReader

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

MARGIN: Final = 0.3
"""Width of the surroundings as a share of the field's longer side."""
MAX_SIDE: Final = 1600
"""Longer side of the picture [pixels]."""
MAX_BYTES: Final = 400_000
"""Size of the picture: 3 s on a link of 1 Mbit/s."""
MAX_MEMORY: Final = 4 << 30
QUALITIES: Final = (80, 65, 50, 35, 20)
REMEDY: Final = "give a GeoTIFF, PNG or JPEG"
GROUND: Final = (217, 223, 210)
"""Colour where the source has no picture."""
LIMIT_S: Final = 300.0
"""Longest time that a background may take [s]."""
_log = logging.getLogger(__name__)


class Background(NamedTuple):
    """A picture in the plane of a field, north up; its extent is west, east, south, north [m]."""

    jpeg: bytes
    extent: tuple[float, float, float, float]


def make_background(source: Path, frame: LocalFrame, boundary: Array) -> Background:
    """The picture of a field and its surroundings.

    :param boundary: corners of the field, shape (n, 2) [m]
    :raises InputError: if the source cannot be used, or does not show the field
    """
    (west, south), (east, north) = boundary.min(axis=0), boundary.max(axis=0)
    margin_m = MARGIN * max(east - west, north - south)
    extent = (west - margin_m, east + margin_m, south - margin_m, north + margin_m)
    if source.is_dir():
        remedy = "give a GeoTIFF: QGIS makes one of the tiles of a web map (Raster > Convert map to raster)"
        raise InputError("is a folder", remedy, source)
    with opened_raster(source, REMEDY) as raster:
        rgb, seen = _warped(raster, source, frame, extent)
    if not seen.any():
        raise InputError("does not show the field", "check its place, and that of the field's datum", source)
    rgb[~seen] = GROUND
    return Background(_jpeg(rgb), extent)


def _warped(
    raster: DatasetReader, path: Path, frame: LocalFrame, extent: tuple[float, ...]
) -> tuple[Pixels, NDArray[np.bool_]]:
    """Colours in the plane of a field, shape (rows, columns, 3), north first, and where there are any."""
    from rasterio import Affine
    from rasterio.enums import ColorInterp, Resampling
    from rasterio.vrt import WarpedVRT

    west, east, south, north = extent
    longer_m = max(east - west, north - south)
    step_m = max(RasterBands(path, raster).pixel_m(frame), longer_m / MAX_SIDE)
    columns, rows = (max(1, round(side / step_m)) for side in (east - west, north - south))
    palette = raster.colorinterp[0] == ColorInterp.palette
    masked = ColorInterp.alpha in raster.colorinterp or raster.nodata is not None
    place = Affine((east - west) / columns, 0, west, 0, -(north - south) / rows, north)
    with WarpedVRT(
        raster, crs=frame.crs.to_wkt(), transform=place, width=columns, height=rows,
        resampling=Resampling.nearest if palette else Resampling.bilinear, add_alpha=not masked,
    ) as warped:  # fmt: skip
        colours = [1, 2, 3] if raster.count >= 3 else [1, 1, 1]
        bands, seen = warped.read(colours), warped.dataset_mask() > 0
    rgb = np.moveaxis(bands, 0, 2)
    if palette:
        table = np.zeros((256, 4), np.uint8)  # red, green, blue and opacity
        for number, colour in raster.colormap(1).items():
            table[number] = colour
        return table[rgb[..., 0], :3], seen
    return _in_8_bits(rgb, seen), seen


def _in_8_bits(rgb: NDArray[Any], seen: NDArray[np.bool_]) -> Pixels:
    """Colours as they are, or stretched from their quantiles if they have more than 8 bits."""
    if rgb.dtype == np.uint8 or not seen.any():
        return np.asarray(rgb, np.uint8)
    low, high = np.nanquantile(rgb[seen], (0.02, 0.98))
    share = (np.nan_to_num(rgb.astype(float)) - low) / max(high - low, 1e-9)
    return np.asarray(np.rint(255 * np.clip(share, 0, 1)), np.uint8)


def _jpeg(rgb: Pixels) -> bytes:
    """The picture in at most :data:`MAX_BYTES`, in the best quality that fits, else smaller."""
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    while True:
        rows, columns, _ = rgb.shape
        profile = {"driver": "JPEG", "width": columns, "height": rows, "count": 3, "dtype": "uint8"}
        for quality in QUALITIES:
            with warnings.catch_warnings(), rasterio.MemoryFile() as memory:
                warnings.simplefilter("ignore", NotGeoreferencedWarning)  # the picture has no place
                with memory.open(**profile, quality=quality, progressive=True) as made:
                    made.write(np.moveaxis(rgb, 2, 0))
                content = bytes(memory.read())
            if len(content) <= MAX_BYTES:
                return content
        rgb = rgb[::2, ::2]


# Has the background made in another process, and serves it ------------------------------------------------------


class BackgroundRoute:
    """Handler of requests for the background; the section ``background`` has extent and version, or an error."""

    def __init__(self, web: Any, source: str, board: Board, jobs: Jobs) -> None:
        self._web, self._source, self._board, self._jobs = web, source, board, jobs
        self._jpeg: bytes | None = None
        self._making: asyncio.Task[None] | None = None

    def add(self, app: Any) -> None:
        """Add the route, and make the background as soon as the application starts."""
        app.on_startup.append(self._start)
        app.on_cleanup.append(self._end)
        app.router.add_get("/background.jpg", self._on_picture)

    async def _start(self, _app: Any) -> None:
        if self._source:
            self._making = asyncio.create_task(self._make())

    async def _end(self, _app: Any) -> None:
        if self._making is not None:
            self._making.cancel()

    async def _make(self) -> None:
        field = self._board.get("field")
        asked = {"source": self._source, "datum": field["datum"], "boundary": field["boundary"]}
        given = json.dumps(asked).encode()
        try:
            _, said = await self._jobs.answer(("-m", "soilmoist_ros.console.background"), given, LIMIT_S)
            answer = json.loads(said.splitlines()[-1])
        except (TimeoutError, ValueError, IndexError):
            answer = {"error": f"{self._source} cannot be made a background"}
        if error := answer.get("error"):
            _log.error("no background: %s", error)
            self._board.put("background", {"error": error})
            return
        self._jpeg = base64.b64decode(answer["jpeg"])
        version = hashlib.sha256(self._jpeg).hexdigest()[:12]
        self._board.put("background", {"extent": answer["extent"], "version": version})

    async def _on_picture(self, _request: Any) -> Any:
        if self._jpeg is None:
            raise self._web.HTTPNotFound
        headers = {"Cache-Control": "private, max-age=86400"}  # the page asks for it by its version
        return self._web.Response(body=self._jpeg, content_type="image/jpeg", headers=headers)


def main() -> None:
    """Make the background that is asked for, with bounded memory."""
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
    given = json.load(sys.stdin)
    answer: dict[str, Any]
    try:
        made = make_background(Path(given["source"]), LocalFrame(*given["datum"]), np.array(given["boundary"]))
        answer = {
            "jpeg": base64.b64encode(made.jpeg).decode(),
            "extent": [round(float(one), 3) for one in made.extent],
        }
    except InputError as error:
        answer = {"error": str(error)}
    print(json.dumps(answer, allow_nan=False))


if __name__ == "__main__":
    main()
