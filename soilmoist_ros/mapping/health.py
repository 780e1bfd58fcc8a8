# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Health of a map that grows, in words and numbers."""

from __future__ import annotations

from soilmoist_ros.foundation import Health, Level
from soilmoist_ros.mapping.field_map import FieldMap
from soilmoist_ros.mapping.map_worker import MapWorker

MAP_PART = "map"
RAIN = "rain"
"""Value of the health of a map with the reason why rain is likely; empty if it is not."""


def map_health(field_map: FieldMap, worker: MapWorker, now_s: float) -> Health:
    """Health of a map.

    :param field_map: what the map is made from
    :param worker: what makes it
    :param now_s: time [s since 1970-01-01 UTC]
    """
    state, mapped, soil_map = field_map.state, worker.mapped, worker.soil_map
    values = {
        "samples": str(len(state.samples)),
        "records": str(state.records),
        "records skipped": str(sum(entry.count for entry in field_map.skipped.values())),
        **{f"skipped: {reason.value}": str(entry.count) for reason, entry in field_map.skipped.items()},
        **{f"last skipped: {reason.value}": entry.example for reason, entry in field_map.skipped.items()},
        "records not yet in the map": str(max(state.records - mapped.records, 0)),
        "age of the map [s]": f"{now_s - mapped.stamp_s:.1f}" if mapped.records else "no map yet",
    }
    if soil_map is not None and soil_map.fit is not None:
        fit, variogram = soil_map.fit, soil_map.variogram
        values |= {
            "model": variogram.model,
            "fitted by": fit.method + ("" if fit.converged else f" (did not converge: {fit.message})"),
            "nugget [(counts/s)^2]": f"{variogram.nugget:.3g}",
            "range [m]": f"{variogram.range_m:.3g}",
            "anisotropy": f"{variogram.anisotropy:.3g} along {variogram.angle_deg:.3g} deg",
            "sill [(counts/s)^2]": f"{variogram.sill:.3g}",
            "standard deviation of the rate": fit.local_text,
            "mean rate [counts/s]": f"{fit.mean_rate:.4g}",
        }
    rain = "" if soil_map is None else soil_map.change.rain(max(now_s, mapped.stamp_s))
    if soil_map is not None:
        values |= {"change of the mean rate": soil_map.change.text or "none", RAIN: rain}
    level, message = _verdict(field_map, worker, rain)
    return Health(MAP_PART, level, message, values)


def _verdict(field_map: FieldMap, worker: MapWorker, rain: str) -> tuple[Level, str]:
    trouble = field_map.trouble
    if worker.failure:
        return Level.ERROR, worker.failure
    if trouble is not None:
        example = field_map.skipped[trouble].example
        return Level.WARN, f"most of the last records were left out ({example}); {trouble.remedy}"
    if not field_map.state.records:
        return Level.OK, "waiting for the first record"
    if worker.soil_map is None:
        return Level.OK, "waiting for enough samples for a map"
    if rain:
        return Level.WARN, rain
    return Level.OK, f"map of {len(worker.mapped.samples)} samples"
