# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Maps computed in a thread while records arrive: always of the newest state, one at a time."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from soilmoist_ros.mapping.field_map import MapState
from soilmoist_ros.mapping.soil_map import SoilMap

_log = logging.getLogger(__name__)


class MapWorker:
    """A thread that computes the map of the last state submitted, and skips the states in between.

    :param compute: makes the map of a state; what it raises is kept in :attr:`failure` and logged
    :param done: called in the thread with every state and its map, ``None`` if the state has too few samples

    Attributes
    ----------
    mapped : MapState
        the state of the last map
    soil_map : SoilMap | None
        the last map
    failure : str
        why the last state has no map, empty if it has one
    """

    def __init__(
        self, compute: Callable[[MapState], SoilMap | None], done: Callable[[MapState, SoilMap | None], None]
    ) -> None:
        self.mapped = MapState()
        self.soil_map: SoilMap | None = None
        self.failure = ""
        self._compute = compute
        self._done = done
        self._next: MapState | None = None
        self._last: MapState | None = None
        self._closing = self._abandoned = False
        self._wake = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="map", daemon=True)
        self._thread.start()

    def submit(self, state: MapState) -> None:
        """Queue a state for its map, unless it was the last one submitted; never waits."""
        with self._wake:
            if state is not self._last:
                self._next = self._last = state
                self._wake.notify()

    def close(self, timeout_s: float = 10.0) -> None:
        """Stop after the map that is being computed, if any; may be called twice.

        :param timeout_s: time after which that map is abandoned: ``done`` is not called for it [s]
        """
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._thread.join(timeout_s)
        self._abandoned = True

    def _run(self) -> None:
        while (state := self._wait()) is not None:
            try:
                soil_map = self._compute(state)
                if not self._abandoned:
                    self._done(state, soil_map)
            except Exception as error:  # one state without a map must not end the maps of a mission
                self.failure = f"no map of {len(state.samples)} samples: {error}"
                _log.exception("the map of %d samples failed", len(state.samples))
            else:
                self.mapped, self.soil_map, self.failure = state, soil_map, ""

    def _wait(self) -> MapState | None:
        """The newest state, as soon as there is one; ``None`` at the end."""
        with self._wake:
            self._wake.wait_for(lambda: self._closing or self._next is not None)
            state, self._next = self._next, None
            return None if self._closing else state
