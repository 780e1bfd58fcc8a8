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
from soilmoist_ros.reporting.exports.irrigation import Plan, Units, irrigation_plan, rate
from soilmoist_ros.reporting.exports.source import ExportSettings, RunSource
from soilmoist_ros.reporting.geometry import right_handed
from soilmoist_ros.reporting.page.frame import round_step

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
_IN_HEADLINE = {"water", "best estimate", "capped at"}
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


def headline(plan: Plan, units: Units) -> str:
    """Advice in one sentence, such as ``No irrigation``."""
    zones, before = plan.irrigated, "" if plan.certain else "Best estimate, not certain: "
    if not zones:
        return f"{before}No irrigation"
    doses = sorted({zone.gross_mm for zone in zones})
    amount = " to ".join(units.dose(dose) for dose in (doses[0], *doses[1:][-1:]))
    wet, whole = (sum(zone.area_m2 for zone in some) * units.per_m2 for some in (zones, plan.zones))
    water = f"{plan.volume_m3 * units.per_m3:,.0f} {units.water}"
    return f"{before}Irrigate {amount} {units.depth} on {wet:.2f} of {whole:.2f} {units.area}: {water}"


def sheet(source: RunSource, plan: Plan, settings: ExportSettings) -> Figure:
    """The page as a figure of matplotlib."""
    figure: Figure = optional_module("matplotlib.figure").Figure(figsize=A4_IN)
    wide, units, left = 1 - 2 * MARGIN, Units.of(settings.rate_unit), plan.capped[1]
    figure.text(MARGIN, 0.945, textwrap.shorten(source.title, 42), size=20, weight="bold", color=INK)
    figure.text(MARGIN, 0.918, headline(plan, units), size=14 if plan.certain else 11, color=INK)
    known = {**plan.facts, "missing [mm]": ""} | {f"missing [{units.depth}]": units.missing(plan.missing_mm)}
    facts = [f"{name}: {value}" for name, value in known.items() if value and name not in _IN_HEADLINE]
    unbroken = "   ".join(fact.replace(" ", "\u00a0") for fact in facts)
    lines = textwrap.fill(unbroken, 96).replace("\u00a0", " ")
    figure.text(MARGIN, 0.910, lines, size=9.5, color=INK, va="top")
    alerts = ["Simulated counts: this is an example, not a field."] if source.simulated else []
    if plan.blurred:
        alerts += textwrap.wrap(plan.blurred, 112)
    if left:
        largest = plan.largest_text(lambda dose: f"{units.dose(dose)} {units.depth}")
        rest = f"{left * units.per_mm:.{units.decimals}f} {units.depth}"
        alerts.append(f"{largest}: about {rest} remain missing.")
    figure.text(MARGIN, 0.881, "\n".join(alerts), size=9, color="#b00020", va="top")
    doses = zones_by_dose(plan.zones)
    colours = dict(zip(doses, _colours(list(doses)), strict=True))
    _map(figure.add_axes((MARGIN, 0.40, wide, 0.445)), source, plan, colours, units)
    _table(figure.add_axes((MARGIN, 0.13, wide, 0.24)), doses, colours, settings.rate_unit, units)
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


def _map(axes: Axes, source: RunSource, plan: Plan, colours: dict[float, str], units: Units) -> None:
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
        at, text = zone.shape.representative_point(), f"{units.dose(zone.gross_mm)} {units.depth}"
        axes.text(at.x, at.y, text, bbox=box, ha="center", va="center", size=9, color=INK)
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


def _table(
    axes: Axes, doses: dict[float, list[DoseZone]], colours: dict[float, str], unit: str, units: Units
) -> None:
    """A row for each dose, and the total."""
    axes.set_axis_off()
    axes.set(xlim=(0, 1), ylim=(MAX_ROWS / 2 + 2, -0.5))
    right: dict[str, Any] = {"ha": "right", "va": "center", "size": 10, "color": INK}
    places = (0.22, 0.38, 0.55, 0.76, 0.96)
    titles = f"area [{units.area}]", f"water [{units.water}]", f"missing [{units.depth}]"
    rows = [(f"dose [{unit}]", *titles, "right with")]

    def sums(zones: list[DoseZone]) -> tuple[str, str]:
        area = f"{sum(zone.area_m2 for zone in zones) * units.per_m2:.2f}"
        return area, f"{sum(zone.volume_m3 for zone in zones) * units.per_m3:,.0f}"

    for zones in list(doses.values())[-MAX_ROWS:]:
        dose = f"{float(f'{rate(zones[0].gross_mm, unit):.4g}'):,g}"
        rows.append(
            (dose, *sums(zones), units.missing(missing_mm(zones)), f"{100 * zones_mean(zones, 'sure'):.0f} %")
        )
    rows.append(("total", *sums([zone for zones in doses.values() for zone in zones]), "", ""))
    step = min(1.0, (MAX_ROWS / 2 + 2) / len(rows))
    for number, row in enumerate(rows):
        weight = "bold" if number in (0, len(rows) - 1) else "normal"
        for at, text in zip(places, row, strict=True):
            axes.text(at, number * step, text, weight=weight, **right)
        if 0 < number < len(rows) - 1:
            colour = colours[list(doses)[-MAX_ROWS:][number - 1]]
            axes.add_patch(_box(0.02, (number - 0.35) * step, 0.06, 0.7 * step, colour))
        axes.plot([0, 1], [(number + 0.5) * step] * 2, color=FAINT, linewidth=0.8)


def _box(x: float, y: float, width: float, height: float, colour: str) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x, y), width, height, facecolor=colour, edgecolor=INK, linewidth=0.6)
