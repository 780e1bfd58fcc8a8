# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Style of the figures: no global state, colours that colour-blind readers can distinguish."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from soilmoist_ros.reporting.colours import colour_ramp

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK = "#22303c"
SOFT = "#5d6b78"
FAINT = "#d5dbe1"
BLUE, ORANGE = "#0072b2", "#d55e00"
SMALL = 8.5


@dataclass(frozen=True)
class Picture:
    """One figure, ready for an HTML file.

    :param uri: the image as a data URI
    :param alt: description in words
    """

    uri: str
    alt: str


def colour_map(name: str) -> Any:
    """The colours of :func:`.colour_ramp`, as matplotlib takes them."""
    from matplotlib.colors import ListedColormap

    return ListedColormap(colour_ramp(name, 256) / 255, name)


def plain_axes(axes: Axes, grid: str = "") -> Axes:
    """Remove the upper and right spines and make the ticks lighter."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(SOFT)
    axes.tick_params(colors=SOFT, labelcolor=INK, labelsize=SMALL, length=3, width=0.8)
    if grid:
        axes.grid(axis=grid, color=FAINT, linewidth=0.7)  # type: ignore[arg-type]
        axes.set_axisbelow(True)
    return axes


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


def data_uri(mime: str, content: bytes) -> str:
    """A file inside a page, such as a picture."""
    return f"data:{mime};base64,{base64.b64encode(content).decode('ascii')}"
