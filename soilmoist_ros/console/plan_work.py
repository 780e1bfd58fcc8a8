"""Work for the page *Plan*, done in a process of its own: forecasts by simulation, files with outlines.

Reads a JSON object from its input and prints one: the answer, or ``{"error": ...}``.
"""

from __future__ import annotations

import base64
import json
import math
import resource
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.foundation.errors import InputError

SEEDS: Final = (1, 2)
"""Simulated fields; the forecast is the mean of their squared errors."""
MAX_HOURS: Final = 12.0
MAX_BYTES: Final = 4 << 30
SUFFIXES: Final = (".geojson", ".json", ".kml", ".zip")
_RANGE_SHARE: Final = 0.25
"""Range parameter of the simulated patterns as a share of the field's extent."""


def field_text(given: Mapping[str, Any]) -> str:
    """A field file of what was drawn.

    :param given: ``name``, ``datum`` [latitude, longitude], ``boundary`` and ``no_go`` [m]
    """
    latitude, longitude = (float(value) for value in given["datum"])
    lines = [
        f"name: {json.dumps(str(given.get('name') or 'drawn field'), ensure_ascii=False)}",
        f"datum: {{latitude_deg: {latitude!r}, longitude_deg: {longitude!r}}}",
        f"polygon: {_ring(given['boundary'])}",
    ]
    if given.get("no_go"):
        lines += ["no_go:", *(f"  - {_ring(area)}" for area in given["no_go"])]
    return "\n".join(lines) + "\n"


def check_field(given: Mapping[str, Any]) -> dict[str, Any]:
    """The field file of what was drawn, after the check that every node does.

    :raises InputError: if it is no field
    """
    from soilmoist_ros.mapping.field import load_field

    text = field_text(given)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "field.yaml"
        path.write_text(text, encoding="utf-8")
        field = load_field(path)
    import shapely

    area = shapely.Polygon(
        field.polygon, [ring for ring in field.no_go if len(ring) >= 3 and _inside(field, ring)]
    )
    return {"file": text, "area_m2": round(area.area)}


def forecast(given: Mapping[str, Any]) -> dict[str, Any]:
    """Error of the map against time, from simulated missions on fields that vary as given.

    :param given: a field as for :func:`field_text`; ``hours``, ``strategy``, ``dwell``; ``rate_cps`` and
        ``variation`` (standard deviation of the field as a share of the mean rate)
    :returns: ``points``: [time [s], root of the mean squared error as a share of the mean rate] in order of time;
        ``stops``, ``distance_m``, ``variation``
    :raises InputError: if a setting cannot be used
    """
    from soilmoist_ros.simulation.mission.settings import MissionSettings
    from soilmoist_ros.simulation.mission.simulator import simulate_mission

    rate, variation = float(given.get("rate_cps") or 4.0), float(given.get("variation") or 0.12)
    hours = float(given.get("hours") or 2.0)
    if not (0 < hours <= MAX_HOURS and 0.01 <= rate <= 1e4 and 0.005 <= variation <= 1.0):
        remedy = f"give up to {MAX_HOURS:g} h, a rate, and a variation of 0.5 to 100 %"
        raise InputError("a forecast cannot be made", remedy)
    extent = max(
        max(corner[axis] for corner in given["boundary"]) - min(corner[axis] for corner in given["boundary"])
        for axis in (0, 1)
    )
    squares: dict[float, list[float]] = {}
    stops, distances = [], []
    with tempfile.TemporaryDirectory() as folder:
        for seed in SEEDS:
            formula = {
                "family": "matern32", "mean": rate, "sd": rate * variation,
                "range_m": round(_RANGE_SHARE * extent, 1), "seed": seed,
            }  # fmt: skip
            path = Path(folder) / f"field{seed}.yaml"
            truth = f"truth:\n  formula: {json.dumps(formula)}\n  hours: {hours!r}\n"
            path.write_text(field_text(given) + truth, encoding="utf-8")
            settings = MissionSettings(
                field=str(path), hours=hours, seed=seed, strategy=str(given.get("strategy") or "gcb"),
                dwell=str(given.get("dwell") or "optimal"), series_every_s=hours * 3600 / 40,
            )  # fmt: skip
            result = simulate_mission(settings)
            for row in result.series:
                if math.isfinite(row.mse):
                    step = round(row.time_s / settings.series_every_s)
                    squares.setdefault(step * settings.series_every_s, []).append(row.mse)
            stops.append(result.series[-1].samples)
            distances.append(result.series[-1].distance_m)
    points = [
        [round(time_s), round(math.sqrt(sum(found) / len(found)) / rate, 5)]
        for time_s, found in sorted(squares.items())
        if len(found) == len(SEEDS)
    ]
    return {
        "points": points,
        "stops": round(sum(stops) / len(stops)),
        "distance_m": round(sum(distances) / len(distances)),
        "variation": variation,
        "rate_cps": rate,
    }


def outline(given: Mapping[str, Any]) -> dict[str, Any]:
    """Boundary and no-go areas of a file in metres about a datum.

    :param given: ``name`` of the file, ``content`` (base64), ``datum`` [latitude, longitude] or nothing
    :returns: ``boundary``, ``no_go``, ``datum``
    :raises InputError: if the file has no polygon that can be read
    """
    import numpy as np

    from soilmoist_ros.foundation.geodesy import LocalFrame
    from soilmoist_ros.foundation.lazy import optional_module

    suffix = Path(str(given["name"])).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{given['name']} cannot be read", f"choose one of: {', '.join(SUFFIXES)}")
    pyogrio, shapely = optional_module("pyogrio", "gis"), optional_module("shapely", "gis")
    pyproj = optional_module("pyproj", "gis")
    try:
        meta, _, shapes, _ = pyogrio.raw.read(base64.b64decode(given["content"], validate=True), columns=[])
    except Exception as error:  # GDAL has many
        raise InputError(f"{given['name']} cannot be read: {error}", "export one polygon again") from None
    polygons = [
        part
        for shape in shapely.from_wkb(shapes)
        if shape is not None
        for part in shapely.get_parts(shape)
        if part.geom_type == "Polygon"
    ]
    if not polygons:
        raise InputError(f"{given['name']} has no polygon", "export the boundary as a polygon")
    field = max(polygons, key=lambda polygon: float(polygon.area))
    to_degrees = pyproj.Transformer.from_crs(meta["crs"] or "EPSG:4326", "EPSG:4326", always_xy=True)
    rings = [np.asarray(ring.coords)[:-1, :2] for ring in (field.exterior, *field.interiors)]
    degrees = [np.column_stack(to_degrees.transform(ring[:, 0], ring[:, 1])) for ring in rings]
    datum = given.get("datum") or np.round(degrees[0].mean(axis=0)[::-1], 7).tolist()
    frame = LocalFrame(float(datum[0]), float(datum[1]))
    metres = [frame.to_local(ring[:, 1], ring[:, 0]).round(2).tolist() for ring in degrees]
    return {"boundary": metres[0], "no_go": metres[1:], "datum": [float(value) for value in datum]}


TASKS: Final[Mapping[str, Callable[[Mapping[str, Any]], dict[str, Any]]]] = {
    "field": check_field,
    "forecast": forecast,
    "outline": outline,
}


def _ring(corners: Any) -> str:
    return json.dumps([[round(float(x_m), 3), round(float(y_m), 3)] for x_m, y_m in corners])


def _inside(field: Any, ring: Any) -> bool:
    import shapely

    return bool(shapely.Polygon(field.polygon).contains(shapely.Polygon(ring)))


def main() -> None:
    """Do one task, with bounded memory: a small file may unpack to a large one."""
    resource.setrlimit(resource.RLIMIT_AS, (MAX_BYTES, MAX_BYTES))
    given = json.load(sys.stdin)
    try:
        answer = TASKS[given["task"]](given)
    except InputError as error:
        answer = {"error": str(error)}
    except (KeyError, TypeError, ValueError) as error:
        answer = {"error": f"this cannot be used: {error}"}
    print(json.dumps(answer, allow_nan=False))


if __name__ == "__main__":
    main()
