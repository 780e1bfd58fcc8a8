# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``gcb``: tours of the whole field, each finer than the one before; the robot visits stop by stop.

A mission consists of passes. Each pass is a tour whose number of stops, dwell and places are chosen together for
the time that the pass may take, and the next pass fills what the one before left uncertain. So the map is good at
any time, and the distance driven stays near that of a lattice. The time of a pass is an orienteering budget
(Vansteenwegen et al. 2011, European Journal of Operational Research 209:1-10): more stops cost driving and
overhead, fewer ones leave gaps; the integrated variance after the pass decides.

Stops are spread by Lloyd's algorithm on the squared posterior variance, which is proportional to the value of the
first second at a place. So stops stand close where the map is uncertain. After each stop the rest of the tour is
moved to where the variance is now, and stops are added or dropped as the time allows.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.strategies.ground import NO_MAP_DWELL_S, Ground
from soilmoist_ros.exploration.strategies.strategy import Choice, Situation
from soilmoist_ros.exploration.strategies.tour_design import Tour, design, renewed, stops_in
from soilmoist_ros.exploration.travel.stop import Stop

Array = NDArray[np.float64]

PASS_ENDS = (1 / 4, 1.0)
"""Ends of the passes as shares of the mission time. Another one at a sixteenth was no better at a quarter, and its
driving cost up to 8 % of the error at the end."""
MIN_STAGED_STOPS = 40
"""A pass is divided into finer ones if the mission time would suffice for at least this many stops in one tour.
With fewer, driving decides; a few counts tell too little of the field to choose the number of stops by the map."""
REDESIGN_EVERY = 5
"""Number of stops after which a tour is compared with a new one, in fields that vary more here than there."""
MIN_STOPS = 3
"""Least number of stops of a pass that is not the last."""


@dataclass
class CostBenefitTour:
    """The next stop of the tour of the current pass.

    :param begun_s: time left at the first choice [s]
    :param ahead: stops of the tour that are still to come, in order
    """

    begun_s: float | None = None
    ahead: tuple[Stop, ...] = ()
    _end_s: float = field(default=0.0, repr=False)
    _done: list[tuple[float, float]] = field(default_factory=list, repr=False)
    _dwell_s: float = field(default=0.0, repr=False)

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """See :class:`Strategy`."""
        left_s = situation.time_left_s
        self.begun_s = max(self.begun_s or 0.0, left_s)
        ground = Ground(situation)
        if not len(ground.stops):
            return None
        tour = self._continued(ground, left_s, rng) or self._begun(ground, left_s, rng)
        if tour is None:
            return None
        stops = [ground.stops[row] for row in tour.stops.tolist()]
        self.ahead = tuple(stops[1:])
        self._done.append((stops[0].x_m, stops[0].y_m))
        reason = f"first of {len(stops)} stops" if len(stops) > 1 else "last stop"
        reason += f" of a tour of {tour.time_s:.0f} s that lowers the variance most"
        return Choice(stops[0], reason, self.ahead, ground.dwell(int(tour.stops[0]), tour.dwell_s))

    def _continued(self, ground: Ground, left_s: float, rng: np.random.Generator) -> Tour | None:
        """The rest of the tour of this pass, as it is best now; ``None`` if the pass is over."""
        row = {stop.name: number for number, stop in enumerate(ground.stops)}
        rows = np.array([row[stop.name] for stop in self.ahead if stop.name in row], np.intp)
        if not len(rows) or left_s <= self._end_s:
            return None
        tour = renewed(ground, rows, np.array(self._done), left_s - self._end_s, self._dwell_s)
        if tour is None or len(self._done) % REDESIGN_EVERY or not ground.is_uneven:
            return tour
        # Lloyd's algorithm does not carry stops from flat ground to a rough patch that was found on the way.
        other = design(ground, left_s - self._end_s, rng, self._dwell_s)
        if other is None or ground.left(other.stops, other.dwell_s) > ground.left(tour.stops, tour.dwell_s):
            return tour
        return other

    def _begun(self, ground: Ground, left_s: float, rng: np.random.Generator) -> Tour | None:
        """The tour of the next pass; ``None`` if no stop fits into the time left."""
        assert self.begun_s is not None
        few = stops_in(ground, self.begun_s) < MIN_STAGED_STOPS
        ends = PASS_ENDS[-1:] if few else PASS_ENDS
        for end in ends:
            end_s = self.begun_s * (1 - end)
            if left_s <= end_s:
                continue
            tour = design(ground, left_s - end_s, rng, NO_MAP_DWELL_S if few else None)
            if tour is not None and (len(tour.stops) >= MIN_STOPS or end == ends[-1]):
                self._end_s, self._dwell_s, self._done = end_s, tour.planned_s, []
                return tour
        # A dwell that no longer fits whole is better than none.
        nearest = np.array([np.argmin(ground.travel_s)], np.intp)
        dwell_s = ground.fixed_dwell_s
        return None if dwell_s is None else Tour(nearest, dwell_s, left_s, dwell_s)
