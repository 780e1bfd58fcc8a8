# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How figures for publications look, and how they are written: SVG and PDF with embedded fonts."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, optional_module
from soilmoist_ros.reporting.page.style import extension, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

FORMATS: Final = ("svg", "pdf")
FOLDER: Final = "figures"
"""Folder of the figures in an output folder."""
COLUMN_IN, TEXT_IN = 84 / 25.4, 174 / 25.4
"""Width of a column and of the text of a journal page [in]: 84 and 174 mm."""
SIZE: Final = 8.0
"""Size of the text [pt]."""
MOISTURE, RATE_TITLE = "Soil moisture [m³/m³]", "Neutron rate [counts/s]"
_VECTOR: Final[dict[str, Any]] = {
    "pdf.fonttype": 42,  # TrueType, embedded: journals refuse Type 3
    "svg.fonttype": "path",  # needs no fonts of the reader
    "font.size": SIZE,
}


def column_figure(height_share: float, width_in: float = COLUMN_IN) -> tuple[Figure, Axes]:
    """A figure of the width of a column with plain axes.

    :param height_share: height as a share of the width
    :param width_in: its width [in]
    :raises InputError: without matplotlib
    """
    figure = vector_figure(width_in, height_share * width_in)
    return figure, plain(figure.add_subplot())


def vector_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure [in].

    :raises InputError: without matplotlib
    """
    made: Figure = optional_module("matplotlib.figure", "reports").Figure(
        figsize=(width_in, height_in), facecolor="white", layout="constrained"
    )
    return made


def caption_axes(axes: Axes, x: str, y: str) -> None:
    """Names of both axes, and the size of all text."""
    axes.set_xlabel(x, fontsize=SIZE)
    axes.set_ylabel(y, fontsize=SIZE)
    axes.tick_params(labelsize=SIZE - 1)


def colour_bar(
    figure: Figure,
    image: AxesImage,
    axes: Axes | list[Axes],
    values: NDArray[np.float64],
    title: str,
    **layout: Any,
) -> None:
    """The scale of colours of images; its ends are pointed where values lie beyond.

    :param image: one of the images
    :param axes: the axes that it stands next to
    :param values: all that the images show
    :param title: quantity and unit
    :param layout: size and place, as of matplotlib's ``Figure.colorbar``
    """
    bar = figure.colorbar(image, ax=axes, extend=extension(values, *image.get_clim()), **layout)
    bar.set_label(title, fontsize=SIZE)
    bar.ax.tick_params(labelsize=SIZE - 1)


def key(axes: Axes) -> None:
    """A key without a frame above the axes, where it hides nothing."""
    axes.legend(
        fontsize=SIZE - 1, frameon=False, handlelength=1.6, loc="lower left", bbox_to_anchor=(0, 1), ncols=2,
        borderaxespad=0.2, columnspacing=1.2,
    )  # fmt: skip


def write_figures(out: Path, figures: Iterable[tuple[str, Figure]], formats: Iterable[str]) -> list[Path]:
    """Write figures to the folder ``figures``; those of an earlier run are removed.

    :param out: output folder
    :param figures: names and figures; made only if there is a format
    :param formats: of :data:`FORMATS`; none writes nothing
    :returns: the files
    :raises InputError: if the folder cannot be written, or matplotlib is missing
    """
    folder, chosen = out / FOLDER, list(dict.fromkeys(formats))
    try:
        for path in [path for ending in FORMATS for path in folder.glob(f"*.{ending}")]:
            path.unlink()
        if not chosen:
            return []
        matplotlib = optional_module("matplotlib", "reports")
        folder.mkdir(parents=True, exist_ok=True)
        written = []
        with matplotlib.rc_context(_VECTOR):
            for name, figure in figures:
                for ending in chosen:
                    path = folder / f"{name}.{ending}"
                    figure.savefig(path, format=ending, metadata={_DATE[ending]: None})
                    written.append(path)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another output folder", folder) from None
    return written


_DATE: Final = {"svg": "Date", "pdf": "CreationDate"}
"""Metadata that would make the same figures differ."""
