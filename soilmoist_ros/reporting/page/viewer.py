# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The map of a report: packed data of its viewer, and pictures for paper and browsers without scripts."""

from __future__ import annotations

import base64
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.mapping import FieldChange, FieldGrid
from soilmoist_ros.pipeline import MapRun
from soilmoist_ros.reporting.certainty import CERTAIN, calibration_of, guess_text
from soilmoist_ros.reporting.colours import (
    DIFFERENCE,
    RATE,
    UNCERTAIN,
    WATER,
    coloured_png,
    data_uri,
    hex_ramp,
    robust_range,
)
from soilmoist_ros.reporting.dose import dose_at
from soilmoist_ros.reporting.geometry import rings
from soilmoist_ros.reporting.page.charts import round_ticks
from soilmoist_ros.reporting.page.decision import DecisionMap, decision
from soilmoist_ros.reporting.page.field_dose import FieldDose, has_level
from soilmoist_ros.reporting.page.frame import percent, plain, round_step
from soilmoist_ros.reporting.page.irrigation import IrrigationAdvice, IrrigationZone

Array = NDArray[np.float64]

NOTHING = 65535
"""Code of a cell without a value."""
MAX_CELLS = 90_000
"""Cells from which a raster is thinned."""
STOPS = 24
ROBOTS = {"blue": "#0072b2", "orange": "#b34700", "green": "#00704f", "purple": "#7a3f7a", "gold": "#8a6d00"}
"""Colours of the robots in order; further robots repeat them from the first."""
MAX_PLACES = 4000
PERCENT = "% by volume"


def thinning(shape: tuple[int, ...]) -> int:
    """Step at which rows and columns are taken so that at most :data:`MAX_CELLS` remain."""
    rows, columns = shape
    return next(step for step in itertools.count(1) if -(-rows // step) * -(-columns // step) <= MAX_CELLS)


def pack(values: Array) -> dict[str, Any]:
    """A raster as 16-bit numbers: value = offset + step * code, row by row from south-west, 65535 for NaN.

    The error is half a step, 1/131 068 of the range.

    :param values: shape (ny, nx)
    """
    finite = np.isfinite(values)
    low, high = (float(values[finite].min()), float(values[finite].max())) if finite.any() else (0.0, 0.0)
    step = (high - low) / (NOTHING - 1) or 1.0
    codes = np.full(values.shape, NOTHING, "<u2")
    codes[finite] = np.round((values[finite] - low) / step).astype("<u2")
    return {"offset": low, "step": step, "data": base64.b64encode(codes.tobytes()).decode("ascii")}


def pack_bits(mask: NDArray[np.bool_]) -> str:
    """A mask, eight cells a byte, row by row from south-west; empty if it is empty."""
    if not mask.any():
        return ""
    return base64.b64encode(np.packbits(mask.ravel(), bitorder="little").tobytes()).decode("ascii")


def rounded(xy: Array, digits: int = 1) -> list[list[float]]:
    """Places as short numbers [m]."""
    return [[round(x, digits), round(y, digits)] for x, y in np.asarray(xy, float).tolist()]


# Data of the map viewer: rasters with their meaning, and what lies on top of them, all in local metres ----------


def map_data(
    frame: LocalFrame, edges: tuple[float, float, float, float], grids: Sequence[FieldGrid],
    layers: Iterable[dict[str, Any]], **more: Any,
) -> dict[str, Any]:  # fmt: skip
    """Data of every map of a page, as plain JSON values; the first grid has the field's edge and no-go areas.

    :param edges: west, east, south, north of the view [m]
    :param more: what lies on top of the layers
    """
    return {
        "view": [round(edge, 2) for edge in edges], "place": place_data(frame, edges), "rootDepth": 0,
        "grids": list(map(grid_data, grids)), "layers": list(layers), "edge": list(map(rounded, rings(grids[0]))),
        "noGo": list(map(rounded, grids[0].holes)),
        **{name: [] for name in ("zones", "samples", "robots", "paths", "visits", "quarantined")}, **more,
    }  # fmt: skip


def viewer_data(run: MapRun, found: IrrigationAdvice) -> dict[str, Any]:
    """Everything that the page's script draws, as plain JSON values."""
    one = run.soil_map.samples
    samples = np.column_stack([one.xy, one.counts, one.exposure_s])
    robots = len(run.tracks_xy)
    return map_data(
        run.frame, view(run), [one.soil_map.grid for one in run.properties], _layers(run, found),
        rootDepth=run.irrigation.root_depth_mm if has_level(run) else 0, zones=_legend(found.zones),
        samples=[[round(x, 1), round(y, 1), int(z), round(t, 2)] for x, y, z, t in _thinned(samples).tolist()],
        robots=[
            {"name": f"robot {number + 1} {name}", "colour": colour}
            for number, (name, colour) in zip(range(robots), itertools.cycle(ROBOTS.items()), strict=False)
            if robots > 1
        ],
        paths=[rounded(_thinned(track)) for track in run.tracks_xy if len(track) > 1],
        visits=[
            [round(v.x_m, 1), round(v.y_m, 1), plain(v.name), round(v.dwell_s, 1), v.raw_counts, v.robot]
            for v in (run.mission.visits if run.mission else ())
        ],
        quarantined=[
            [round(record.x_m, 1), round(record.y_m, 1), record.quarantine.replace("_", " ")]
            for record in run.quarantined
            if math.isfinite(record.x_m)
        ],
    )  # fmt: skip


def _legend(zones: Sequence[IrrigationZone]) -> list[dict[str, str]]:
    return [{"name": zone.name, "limits": zone.limits, "colour": zone.colour} for zone in zones]


def view(run: MapRun) -> tuple[float, float, float, float]:
    """West, east, south, north [m] of the field, the samples and the track, with a margin."""
    points = np.vstack([run.soil_map.grid.box, run.soil_map.samples.xy, *run.tracks_xy])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.03 * float(max(high - low))
    (west, south), (east, north) = (low - margin).tolist(), (high + margin).tolist()
    return west, east, south, north


def interval_width(run: MapRun) -> Array:
    """Width of the 90 % interval of the moisture [% by volume]."""
    return np.asarray(100 * (run.soil_map.vwc_p95 - run.soil_map.vwc_p05))


def moisture_limits(run: MapRun) -> tuple[float, float]:
    """Colour limits of the moisture [% by volume], within what the soil can hold."""
    limits = run.soil_map.limits
    within = None if limits is None else (100 * limits.dryness, max(100 * limits.saturation, 1.0))
    return colour_limits(100 * run.soil_map.vwc, interval_width(run) / 3.3, within)


def colour_limits(
    values: Array, spread: Array | None = None, within: tuple[float, float] | None = None
) -> tuple[float, float]:
    """Round colour limits: the middle 95 % of the values, at least a typical uncertainty to both sides."""
    low, high = robust_range(values)
    if spread is not None and np.isfinite(spread).any():
        middle, typical = (low + high) / 2, float(np.nanmedian(spread))
        away = max((high - low) / 2, min(typical, abs(high)))
        low, high = middle - away, middle + away
    step = round_step((high - low) / 6)
    low, high = step * math.floor(low / step + 1e-6), step * math.ceil(high / step - 1e-6)
    if within is not None:
        low, high = max(low, within[0]), min(high, within[1])
    return (low, high) if high > low else (low, low + step)


def grid_data(grid: FieldGrid) -> dict[str, Any]:
    """Place and size of the rasters of a grid."""
    step = thinning(grid.mask.shape)
    ny, nx = grid.mask[::step, ::step].shape
    place = {"x0": float(grid.x_m[0]), "y0": float(grid.y_m[0]), "cell": float(grid.cell_m * step)}
    return {**place, "nx": nx, "ny": ny}


def _layers(run: MapRun, found: IrrigationAdvice) -> Iterator[dict[str, Any]]:
    """The layers in the order of the choice; those without a title are only read."""
    for index, one in enumerate(run.properties):
        name = f"{one.label or one.name}: " if index else ""
        first, *more = _of_property(one, index, name)
        yield first
        if index == 0:
            if (decided := decision(one)) is not None:
                yield from _decision(one, decided)
            yield _layer(
                one, 0, "zone", found.number, title="Irrigation zones", kind="zones",
                hatch=_hatch(one, np.isfinite(found.number) & ~found.sure), hatchText="zone not certain",
                about=f"Zones as in the table. Hatched: the probability of the zone is below {percent(CERTAIN)}.",
            )  # fmt: skip
            if isinstance(found.dose, FieldDose) and found.dose.irrigated:
                yield _dose(one, found.dose)
        yield from more
        if one.change is not None:
            yield from _change(one, one.change.change, index, name)
        if one.truth_rate is not None:
            yield from _truth(one, np.asarray(one.truth_rate, float), index, name)


def _of_property(run: MapRun, index: int, name: str) -> Iterator[dict[str, Any]]:
    soil_map, end = run.soil_map, _end(index)
    if run.calibrated:
        unit = PERCENT + guess_text(calibration_of(run))
        yield _layer(
            run, index, "vwc", 100 * soil_map.vwc,
            **shown_as(f"{name}Soil moisture", unit, 1, WATER, moisture_limits(run)),
            low=f"p05{end}", high=f"p95{end}",
            hatch=_hatch(run, soil_map.beyond_limits & soil_map.grid.mask),
            hatchText="very unsure: the interval reaches a limit of the soil",
            about="Pale is dry, dark blue is wet. Hatched: the interval reaches dry or saturated soil.",
        )  # fmt: skip
        yield _layer(run, index, "p05", 100 * soil_map.vwc_p05)
        yield _layer(run, index, "p95", 100 * soil_map.vwc_p95)
        look = shown_as(f"{name}How sure", PERCENT, 1, UNCERTAIN, (0.0, colour_limits(interval_width(run))[1]))
        yield _layer(
            run, index, "width", **look, minus=[f"p95{end}", f"p05{end}"], name="Width of the 90 % interval",
            about="Width of the 90 % interval of the moisture: dark is unsure. Measure there next.",
        )  # fmt: skip
    rate, sd = soil_map.rate, soil_map.rate_sd
    look = shown_as(f"{name}Neutron rate", "counts/s", 2, RATE, colour_limits(rate, sd))
    about = "What was measured, corrected for the atmosphere. More neutrons mean drier soil."
    yield _layer(run, index, "rate", rate, **look, sd=f"rate_sd{end}", about=about)
    look = shown_as(f"{name}Rate uncertainty", "counts/s", 3, UNCERTAIN, (0.0, colour_limits(sd)[1]))
    about = "One standard deviation of the true rate, given all counts."
    yield _layer(run, index, "rate_sd", sd, **look, about=about)


def _decision(run: MapRun, found: DecisionMap) -> Iterator[dict[str, Any]]:
    """The zones by the thresholds of the mission, and the probability that a place is in the right one."""
    inside = np.isfinite(found.number)
    yield _layer(
        run, 0, "decision", found.number, title="Decision", kind="zones", hatchText="zone not certain",
        hatch=_hatch(run, inside & (found.probability < CERTAIN)),
        zones=_legend(found.zones),
        about=f"Zones by the thresholds of the mission. Hatched: the probability of the zone is below "
        f"{percent(CERTAIN)}.",
    )  # fmt: skip
    yield _layer(
        run, 0, "right", 100 * found.probability, **shown_as("Decision: how sure", "%", 0, WATER, (0.0, 100.0)),
        about="Probability that the true value of a place lies in its zone: dark is sure.",
    )  # fmt: skip


def _dose(run: MapRun, found: FieldDose) -> dict[str, Any]:
    """Layer of the dose that the machine applies."""
    mask = run.soil_map.grid.mask
    values, unsure = np.full(mask.shape, np.nan), np.zeros(mask.shape, bool)
    values[mask] = dose_at(found.zones, run.soil_map.grid.cells)
    unsure[mask] = np.maximum(found.dose.needed, 1 - found.dose.needed) < CERTAIN
    most = max(zone.gross_mm for zone in found.zones)
    return _layer(
        run, 0, "dose", values, **shown_as("Dose", "mm", 0, WATER, (0.0, most)),
        hatch=_hatch(run, unsure), hatchText="not certain if it needs water now",
        about=f"What the machine applies. Hatched: certain of the need with less than {percent(CERTAIN)}.",
    )  # fmt: skip


def _change(run: MapRun, change: FieldChange, index: int, name: str) -> Iterator[dict[str, Any]]:
    """The change since an earlier survey: of the moisture if there is a calibration, else of the rate."""
    moist = run.calibrated
    values, sd = (100 * change.vwc, 100 * change.vwc_sd) if moist else (change.rate, change.rate_sd)
    most = colour_limits(np.abs(values), sd)[1]
    # Brown is dry in both: less moisture, or more neutrons.
    unit, digits, colour = (PERCENT, 1, DIFFERENCE) if moist else ("counts/s", 2, f"{DIFFERENCE}_r")
    yield _layer(
        run, index, "change", values, **shown_as(f"{name}Change", unit, digits, colour, (-most, most)),
        sd=f"change_sd{_end(index)}", hatchText="not significant",
        hatch=_hatch(run, (change.significant == 0) & run.soil_map.grid.mask),
        about="Change since the latest earlier survey: brown is drier, green is wetter. Hatched: the change "
        "may be chance (false discovery rate 5 %).",
    )  # fmt: skip
    yield _layer(run, index, "change_sd", sd)


def _truth(run: MapRun, truth: Array, index: int, name: str) -> Iterator[dict[str, Any]]:
    """The known truth of a simulation and the error of the map."""
    rate, end = run.soil_map.rate, _end(index)
    most = colour_limits(np.abs(rate - truth))[1]
    look = shown_as(f"{name}True rate", "counts/s", 2, RATE, colour_limits(rate, run.soil_map.rate_sd))
    yield _layer(
        run, index, "truth", truth, **look, about="What the map of the rate should show, in the same colours."
    )
    yield _layer(
        run, index, "error", **shown_as(f"{name}Error", "counts/s", 2, f"{DIFFERENCE}_r", (-most, most)),
        minus=[f"rate{end}", f"truth{end}"], name="Map minus truth",
        about="Estimate minus truth: brown where the map is too dry, green where it is too wet.",
    )  # fmt: skip


def _end(index: int) -> str:
    """End of the keys of a property."""
    return str(index) if index else ""


def _layer(run: MapRun, index: int, key: str, values: Array | None = None, **look: Any) -> dict[str, Any]:
    """A raster of the field's cells with its look; the script computes one without values from two others."""
    packed = {} if values is None else pack(_cells(run, np.where(run.soil_map.grid.mask, values, np.nan)))
    return {"key": f"{key}{_end(index)}", "grid": index, **packed, **look}


def _hatch(run: MapRun, mask: NDArray[np.bool_]) -> str:
    return pack_bits(_cells(run, mask))


def shown_as(title: str, unit: str, digits: int, colour_map: str, limits: tuple[float, float]) -> dict[str, Any]:
    """Name, unit and colours of a layer."""
    low, high = limits
    ticks = [value for value, _ in round_ticks(low, high, 5)]
    colours = {"colours": hex_ramp(colour_map, STOPS), "from": low, "to": high, "ticks": ticks}
    return {"title": title, "unit": unit, "digits": digits, **colours}


def _cells(run: MapRun, values: Any) -> Any:
    step = thinning(run.soil_map.grid.mask.shape)
    return values[::step, ::step]


def place_data(frame: LocalFrame, view: tuple[float, float, float, float]) -> dict[str, Any]:
    """Latitude and longitude as quadratic polynomials of local kilometres about the middle of a view.

    :param view: west, east, south, north [m]
    """
    west, east, south, north = view
    x_m, y_m, reach_m = (west + east) / 2, (south + north) / 2, max(east - west, north - south) / 2
    steps = np.linspace(-reach_m, reach_m, 5)
    dx, dy = (axis.ravel() / 1000 for axis in np.meshgrid(steps, steps))
    places = frame.to_geographic(np.column_stack([x_m + 1000 * dx, y_m + 1000 * dy]))
    terms = np.column_stack([np.ones_like(dx), dx, dy, dx * dx, dx * dy, dy * dy])
    weights = np.linalg.lstsq(terms, places, rcond=None)[0]
    return {"x": x_m, "y": y_m, "latitude": weights[:, 0].tolist(), "longitude": weights[:, 1].tolist()}


def _thinned(rows: Array) -> Array:
    return rows[:: max(1, -(-len(rows) // MAX_PLACES))]


# The map and its uncertainty for browsers without scripts -------------------------------------------------------


def pictures(run: MapRun) -> Iterator[dict[str, Any]]:
    """The map and its uncertainty of each property, one pixel a cell, with its look and a description in words."""
    for one in run.properties:
        soil_map, name = one.soil_map, f" of {one.label or one.name}" if run.others else ""
        looks = {layer["key"]: layer for layer in _of_property(one, 0, "")}
        of_rate = {"rate": soil_map.rate, "rate_sd": soil_map.rate_sd}
        of_moisture = {"vwc": 100 * soil_map.vwc, "width": interval_width(one)}
        (west, _), (east, _) = soil_map.grid.box
        for key, band in (of_moisture if one.calibrated else of_rate).items():
            look, inside = looks[key], _cells(one, np.where(soil_map.grid.mask, band, np.nan))
            colours = np.array([list(bytes.fromhex(colour[1:])) for colour in look["colours"]], np.uint8)
            picture = coloured_png((inside[::-1] - look["from"]) / (look["to"] - look["from"]), colours)
            yield {
                **{part: look[part] for part in ("colours", "ticks", "digits", "from", "to")},
                "uri": data_uri("image/png", picture),
                "alt": f"Map{name}: {look.get('name', look['title'])} [{look['unit']}] in "
                f"{run.field_name or 'the field'}, {east - west:.0f} m from west to east, north is up",
            }
