# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Style of the figures: no global state, colours that colour-blind readers can distinguish."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from soilmoist_ros.reporting.colours import colour_ramp

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#22303c"
SOFT = "#5d6b78"
FAINT = "#d5dbe1"
BLUE, ORANGE, GREEN, PURPLE, GOLD = "#0072b2", "#d55e00", "#009e73", "#8c4a8c", "#c9a000"
SMALL, NORMAL, LARGE = 8.5, 9.5, 11.0
PNG_DPI = 190
LARGEST_SVG = 250_000


@dataclass(frozen=True)
class Picture:
    """One figure, ready for an HTML file.

    :param uri: the image as a data URI
    :param alt: description in words
    """

    uri: str
    alt: str


@dataclass(frozen=True)
class Section:
    """One figure of a page with its texts.

    :param key: anchor in the page
    :param title: heading
    :param picture: the figure
    :param caption: what to see in it
    """

    key: str
    title: str
    picture: Picture
    caption: str


def colour_map(name: str) -> Any:
    """The colours of :func:`.colour_ramp`, as matplotlib takes them."""
    from matplotlib.colors import ListedColormap

    return ListedColormap(colour_ramp(name, 256) / 255, name)


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty white figure that does not use pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def plain(axes: Axes, grid: str = "") -> Axes:
    """Remove the upper and right spines and make the ticks lighter."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(SOFT)
    axes.tick_params(colors=SOFT, labelcolor=INK, labelsize=SMALL, length=3, width=0.8)
    if grid:
        axes.grid(axis=grid, color=FAINT, linewidth=0.7)  # type: ignore[arg-type]
        axes.set_axisbelow(True)
    return axes


def label(axes: Axes, x: str = "", y: str = "", title: str = "") -> None:
    """Axis labels and a title at the left."""
    axes.set_xlabel(x, fontsize=NORMAL, color=INK)
    axes.set_ylabel(y, fontsize=NORMAL, color=INK)
    if title:
        axes.set_title(title, fontsize=NORMAL, color=INK, loc="left", fontweight="bold")


def legend(axes: Axes, **kwargs: Any) -> None:
    """A legend without a frame above the axes, where it hides no data."""
    where = {
        "loc": "lower left",
        "bbox_to_anchor": (0.0, 1.0),
        "borderaxespad": 0.2,
        "ncols": 4,
        "columnspacing": 1.3,
    }
    axes.legend(**{"fontsize": SMALL, "frameon": False, "labelcolor": INK, "handlelength": 1.6, **where, **kwargs})


def robust_range(values: ArrayLike, share: float = 0.95) -> tuple[float, float]:
    """Colour limits around the middle ``share`` of the values.

    A flat map gets limits around its value, so that rounding errors do not look like contrast.
    """
    finite = np.asarray(values, float)
    finite = finite[np.isfinite(finite)]
    if finite.size == 0:
        return 0.0, 1.0
    low, high = (float(q) for q in np.quantile(finite, (0.5 - share / 2, 0.5 + share / 2)))
    least = max(abs(low), abs(high), 1e-9) * 1e-3
    if high - low < least:
        middle = (low + high) / 2
        low, high = middle - least, middle + least
    return low, high


def extension(values: ArrayLike, low: float, high: float) -> str:
    """The ends of a colour bar that need an arrow, as matplotlib's ``extend``."""
    below, above = bool(np.nanmin(values, initial=low) < low), bool(np.nanmax(values, initial=high) > high)
    return {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[below, above]


def picture(figure: Figure, alt: str, vector: bool = False) -> Picture:
    """Render as SVG if requested and small, else as PNG at twice the screen's resolution."""
    if vector:
        svg = _render(figure, "svg")
        if len(svg) <= LARGEST_SVG:
            return Picture(data_uri("image/svg+xml", svg), alt)
    return Picture(data_uri("image/png", _render(figure, "png")), alt)


def _render(figure: Figure, kind: str) -> bytes:
    stream = io.BytesIO()
    metadata: dict[str, Any] = {"Date": None} if kind == "svg" else {"Software": None}
    figure.savefig(stream, format=kind, dpi=PNG_DPI if kind == "png" else 72, metadata=metadata)
    return stream.getvalue()


def data_uri(mime: str, content: bytes) -> str:
    """A file inside a page, such as a picture."""
    return f"data:{mime};base64,{base64.b64encode(content).decode('ascii')}"
