# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Irrigation sheet: one page of A4 to print, with the zones of a dose, their water and how sure they are."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from soilmoist_ros.foundation import optional_module
from soilmoist_ros.reporting.colours import FAINT, INK, SOFT, WATER, hex_ramp
from soilmoist_ros.reporting.dose import DoseZone, missing_mm, zones_by_dose, zones_mean
from soilmoist_ros.reporting.exports.irrigation import Plan, irrigation_plan, missing_text, rate
from soilmoist_ros.reporting.exports.source import ExportSettings, RunSource
from soilmoist_ros.reporting.geometry import right_handed
from soilmoist_ros.reporting.page.frame import percent, round_step

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from shapely.geometry.base import BaseGeometry

A4_IN = 210 / 25.4, 297 / 25.4
"""Width and height of the page [in]."""
MARGIN = 0.09
"""Margin of the page, as a share of its width."""
MAX_ROWS = 14
"""Doses in the table; more are on the map and in the total only."""
MIN_LABEL_SHARE = 0.01
"""Area of a zone, as a share of the field, from which its dose stands on the map."""
IN_TITLE = "calibration", "survey", "typical soil"
"""Facts of the plan below the title; the advice has the others."""
_FONTS = {"pdf.fonttype": 42, "font.size": 10.0}


def write_sheet(source: RunSource, folder: Path, settings: ExportSettings) -> list[Path]:
    """Write ``irrigation.pdf``.

    :raises InputError: if there is no dose, or matplotlib is missing
    """
    plan = irrigation_plan(source)
    path = folder / "irrigation.pdf"
    with optional_module("matplotlib").rc_context(_FONTS):
        sheet(source, plan, settings).savefig(path, format="pdf", metadata={"CreationDate": None})
    return [path]


def sheet(source: RunSource, plan: Plan, settings: ExportSettings) -> Figure:
    """The page as a figure of matplotlib: the advice of the report, zones with their doses, and their table."""
    figure: Figure = optional_module("matplotlib.figure").Figure(figsize=A4_IN)
    wide, doses = 1 - 2 * MARGIN, zones_by_dose(plan.zones)
    figure.text(MARGIN, 0.945, textwrap.shorten(source.title, 42), size=20, weight="bold", color=INK)
    known = [f"{name}: {plan.facts[name]}" for name in IN_TITLE if name in plan.facts]
    figure.text(MARGIN, 0.925, "   ".join(known), size=9.5, color=SOFT)
    advice = textwrap.fill(str((source.run.summary.get("irrigation") or {}).get("advice") or ""), 96)
    figure.text(MARGIN, 0.912, advice, size=10, color=INK, va="top", linespacing=1.4)
    colours = dict(zip(doses, _colours(list(doses)), strict=True))
    _map(figure.add_axes((MARGIN, 0.40, wide, 0.38)), source, plan, colours)
    _table(figure.add_axes((MARGIN, 0.13, wide, 0.24)), doses, colours, settings.rate_unit)
    about = (
        "Doses are gross: with the losses of the irrigation. Missing is the water that the root zone lacks, the "
        "mean of the field with the 90 % interval of a place. Right with: probability that the dose is the right "
        "step. Nothing is given in hatched areas."
    )
    text = textwrap.fill(about, 112)
    figure.text(MARGIN, 0.105, text, size=8.5, color=SOFT, va="top", linespacing=1.4)
    return figure


def _colours(doses: list[float]) -> list[str]:
    """White for no water, darker for more."""
    wet = [dose for dose in doses if dose > 0]
    return ["#ffffff"] * (len(doses) - len(wet)) + hex_ramp(WATER, len(wet) + 1)[1:]


def _map(axes: Axes, source: RunSource, plan: Plan, colours: dict[float, str]) -> None:
    """Zones with their doses, a scale and an arrow to the north."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Line

    def draw(shape: BaseGeometry, **look: Any) -> None:
        for part in getattr(shape, "geoms", [shape]):
            part = right_handed(part)
            rings = [Line(np.asarray(ring.coords), closed=True) for ring in (part.exterior, *part.interiors)]
            axes.add_patch(PathPatch(Line.make_compound_path(*rings), edgecolor=INK, linewidth=0.8, **look))

    for shape in source.no_go:
        draw(shape.intersection(source.boundary.convex_hull), facecolor="white", hatch="///")
    box = {"boxstyle": "round,pad=0.2", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}
    for zone in plan.zones:
        draw(zone.shape, facecolor=colours[zone.gross_mm])
        if zone.area_m2 < MIN_LABEL_SHARE * source.boundary.area:
            continue
        at = zone.shape.representative_point()
        axes.text(at.x, at.y, f"{zone.gross_mm:g} mm", bbox=box, ha="center", va="center", size=9, color=INK)
    west, south, east, north = source.boundary.bounds
    axes.set(xlim=(west, east), ylim=(south - 0.08 * (north - south), north), aspect="equal")
    axes.set_axis_off()
    length = round_step((east - west) / 5)
    down = south - 0.05 * (north - south)
    axes.plot([west, west + length], [down, down], color=INK, linewidth=2, solid_capstyle="butt")
    axes.text(west + length, down, f"  {length:g} m", va="center", size=9, color=INK)
    arrow: dict[str, Any] = {"arrowstyle": "-|>", "color": INK}
    axes.annotate("", (0.99, 1.0), (0.99, 0.92), xycoords="axes fraction", arrowprops=arrow, annotation_clip=False)
    axes.text(0.99, 1.005, "N", transform=axes.transAxes, ha="center", va="bottom", weight="bold", color=INK)


def _table(axes: Axes, doses: dict[float, list[DoseZone]], colours: dict[float, str], unit: str) -> None:
    """A row for each dose, in the unit of the rate too, and the total."""
    axes.set_axis_off()
    axes.set(xlim=(0, 1), ylim=(MAX_ROWS / 2 + 2, -0.5))
    right: dict[str, Any] = {"ha": "right", "va": "center", "size": 10, "color": INK}
    places = (0.27, 0.40, 0.55, 0.76, 0.96)
    rows = [(f"dose [{unit}]", "area [ha]", "water [m³]", "missing [mm]", "right with")]

    def sums(zones: list[DoseZone]) -> tuple[str, str]:
        area_ha, water_m3 = (sum(getattr(z, name) for z in zones) for name in ("area_m2", "volume_m3"))
        return f"{area_ha / 1e4:.2f}", f"{water_m3:,.0f}"

    for gross_mm, zones in list(doses.items())[-MAX_ROWS:]:
        dose = f"{float(f'{rate(gross_mm, unit):.4g}'):,g}"
        dose = dose if unit == "mm" else f"{gross_mm:g} mm = {dose}"
        rows.append((dose, *sums(zones), missing_text(missing_mm(zones)), percent(zones_mean(zones, "sure"))))
    rows.append(("total", *sums([zone for zones in doses.values() for zone in zones]), "", ""))
    step = min(1.0, (MAX_ROWS / 2 + 2) / len(rows))
    for number, row in enumerate(rows):
        weight = "bold" if number in (0, len(rows) - 1) else "normal"
        for at, text in zip(places, row, strict=True):
            axes.text(at, number * step, text, weight=weight, **right)
        if 0 < number < len(rows) - 1:
            colour = colours[list(doses)[-MAX_ROWS:][number - 1]]
            axes.add_patch(_box(0.0, (number - 0.35) * step, 0.04, 0.7 * step, colour))
        axes.plot([0, 1], [(number + 0.5) * step] * 2, color=FAINT, linewidth=0.8)


def _box(x: float, y: float, width: float, height: float, colour: str) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x, y), width, height, facecolor=colour, edgecolor=INK, linewidth=0.6)
