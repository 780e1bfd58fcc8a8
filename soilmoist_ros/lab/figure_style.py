# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Look of the figures of a campaign: no global state, colours that colour-blind readers can distinguish."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from soilmoist_ros.reporting import colour_ramp

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, SOFT, FAINT = "#22303c", "#5d6b78", "#d5dbe1"
BLUE, ORANGE, GREEN = "#0072b2", "#d55e00", "#009e73"
SMALL, NORMAL = 8.5, 9.5
"""Sizes of text [pt]."""
PNG_DPI = 190
LARGEST_SVG = 250_000
"""Larger drawings become pictures of pixels [bytes]."""
TEXT_IN = 174 / 25.4
"""Width of the text of a journal page [in]."""
HEIGHTENED, ENLARGED = 1.12, 1.07
"""Height and text of a figure grow by more than the share of the width, to be read on paper."""


@dataclass(frozen=True)
class FigureImage:
    """One figure, ready for an HTML file.

    :param uri: the image as a data URI
    :param alt: description in words
    """

    uri: str
    alt: str


@dataclass(frozen=True)
class FigureSection:
    """One figure of a page with its texts.

    :param key: anchor in the page
    :param title: heading
    :param picture: the figure
    :param caption: what to see in it
    """

    key: str
    title: str
    picture: FigureImage
    caption: str


def colours(name: str) -> Any:
    """A colour map of the reports, as matplotlib takes it."""
    from matplotlib.colors import ListedColormap

    return ListedColormap(colour_ramp(name, 256) / 255, name)


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty white figure that does not use pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def plain_axes(axes: Axes, grid: str = "") -> Axes:
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


def of_text_width(figure: Figure) -> Figure:
    """A figure for the screen, made as wide as the text of a journal page: smaller, with thinner lines."""
    from matplotlib.lines import Line2D
    from matplotlib.text import Text

    width_in, height_in = figure.get_size_inches()
    share = TEXT_IN / width_in
    figure.set_size_inches(TEXT_IN, HEIGHTENED * share * height_in)
    for text in figure.findobj(Text):
        text.set_fontsize(ENLARGED * share * text.get_fontsize())
    for line in figure.findobj(Line2D):
        line.set_linewidth(share * line.get_linewidth())
    return figure


def extension(values: ArrayLike, low: float, high: float) -> str:
    """The ends of a colour bar that need an arrow, as matplotlib's ``extend``."""
    below, above = bool(np.nanmin(values, initial=low) < low), bool(np.nanmax(values, initial=high) > high)
    return {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[below, above]


def picture(figure: Figure, alt: str, vector: bool = False) -> FigureImage:
    """Render as SVG if requested and small, else as PNG at twice the screen's resolution."""
    if vector:
        svg = _render(figure, "svg")
        if len(svg) <= LARGEST_SVG:
            return FigureImage(_data_uri("image/svg+xml", svg), alt)
    return FigureImage(_data_uri("image/png", _render(figure, "png")), alt)


def _render(figure: Figure, kind: str) -> bytes:
    stream = io.BytesIO()
    metadata: dict[str, Any] = {"Date": None} if kind == "svg" else {"Software": None}
    figure.savefig(stream, format=kind, dpi=PNG_DPI if kind == "png" else 72, metadata=metadata)
    return stream.getvalue()


def _data_uri(mime: str, content: bytes) -> str:
    return f"data:{mime};base64,{base64.b64encode(content).decode('ascii')}"
