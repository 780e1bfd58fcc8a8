# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps computed in a thread while records arrive: always of the newest state, one at a time; and their health."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

from soilmoist_ros.foundation import Batches, Health, Level
from soilmoist_ros.mapping.field_map import FieldMap, MapState
from soilmoist_ros.mapping.soil_map import SoilMap

_log = logging.getLogger(__name__)


class MapWorker:
    """A thread that computes the map of the last state submitted, and skips the states in between.

    :param compute: makes the map of a state; what it raises is kept in :attr:`failure` and logged
    :param done: called in the thread with every state and its map, ``None`` if the state has too few samples
    """

    PART = "map"
    """Name of the health of a map."""
    RAIN = "rain"
    """Value of this health with the reason why rain is likely; empty if it is not."""

    def __init__(
        self, compute: Callable[[MapState], SoilMap | None], done: Callable[[MapState, SoilMap | None], None]
    ) -> None:
        self.mapped = MapState()
        self.soil_map: SoilMap | None = None
        self.failure = ""  # why the last state has no map
        self._compute = compute
        self._done = done
        self._last: MapState | None = None
        self._closing = self._abandoned = False
        self._states: Batches[MapState] = Batches(self._map, "map")

    def submit(self, state: MapState) -> None:
        """Queue a state for its map, unless it was the last one submitted; never waits."""
        if state is not self._last:
            self._last = state
            self._states.put(state)

    def close(self, timeout_s: float = 10.0) -> None:
        """Stop after the map being computed, or abandon it (no ``done``) after this time; may be called twice."""
        self._closing = True
        self._states.close(timeout_s)
        self._abandoned = True

    def _map(self, states: Sequence[MapState]) -> None:
        """Compute the map of the newest of the states that wait."""
        state = states[-1]
        if self._closing:
            return
        try:
            soil_map = self._compute(state)
            if not self._abandoned:
                self._done(state, soil_map)
        except Exception as error:  # one state without a map must not end the maps of a mission
            self.failure = f"no map of {len(state.samples)} samples: {error}"
            _log.exception("the map of %d samples failed", len(state.samples))
        else:
            self.mapped, self.soil_map, self.failure = state, soil_map, ""


# -- Health --------------------------------------------------------------------------------------------------


def map_health(field_map: FieldMap, worker: MapWorker, now_s: float) -> Health:
    """Health of a map."""
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
            "fitted by": fit.method + ("" if fit.converged else " (did not converge)"),
            "nugget [(counts/s)^2]": f"{variogram.nugget:.3g}",
            "range [m]": f"{variogram.range_m:.3g}",
            "anisotropy": f"{variogram.anisotropy:.3g} along {variogram.angle_deg:.3g} deg",
            "sill [(counts/s)^2]": f"{variogram.sill:.3g}",
            "mean rate [counts/s]": f"{fit.mean_rate:.4g}",
        }
    rain = "" if soil_map is None else soil_map.change.rain(max(now_s, mapped.stamp_s))
    if soil_map is not None:
        values |= {"change of the mean rate": soil_map.change.text or "none", worker.RAIN: rain}
    level, message = _verdict(field_map, worker, rain)
    return Health(worker.PART, level, message, values)


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
    return Level.OK, f"samples in the map: {len(worker.mapped.samples)}"
