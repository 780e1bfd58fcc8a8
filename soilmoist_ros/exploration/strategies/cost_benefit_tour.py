"""``gcb``: a tour of several stops, built by benefit and cost; the robot drives to the first one.

Zhang & Vorobeychik (2016), AAAI 3119-3126: insert, one by one, the stop with the largest gain per second that it
adds to the tour, as long as the tour fits into the time; here on the posterior covariance, with what is counted on
the way, and planned anew at each stop.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.planning.dwell import MAX_DWELL_S
from soilmoist_ros.exploration.planning.planning_model import PlanningModel, best_dwell
from soilmoist_ros.exploration.planning.prospect import Prospect
from soilmoist_ros.exploration.strategies.information import VarianceReduction
from soilmoist_ros.exploration.strategies.strategy import Choice, Situation

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

HORIZON = 0.5
"""The tour looks ahead for this share of the time used so far, times the share of the mission that it is."""
MAX_ON_DETOUR_S = 60.0
"""Longest time that the robot counts near a stop while it drives there and away [s]."""
MAX_STOPS = 12
"""Largest number of stops of a tour; a new tour is planned long before the last one."""


@dataclass
class CostBenefitTour:
    """The first stop of the tour that lowers the integrated variance most within a horizon.

    The tour begins as that of ``ivr``, and the horizon grows with the square of the time used. Early in a mission
    the two are one: each trip lowers the variance much, and what comes after it cannot be foreseen. Later many
    trips are worth about the same, and the tour makes of them one with little driving.
    """

    begun_s: float | None = None

    def choose(self, situation: Situation, rng: np.random.Generator) -> Choice | None:
        """See :class:`Strategy`."""
        first = VarianceReduction().choose(situation, rng)
        self.begun_s = max(self.begun_s or 0.0, situation.time_left_s)
        prospect = situation.prospect() if situation.prospect is not None else None
        if prospect is None or first is None:
            return first
        used_s = self.begun_s - situation.time_left_s
        horizon_s = min(HORIZON * used_s**2 / self.begun_s, situation.time_left_s)
        best = int(np.argmax(prospect.worth.value))
        if prospect.reachable[best] == prospect.staying:
            return first
        tour = _Tour(prospect, best)
        while len(tour.stops) < MAX_STOPS and tour.insert(horizon_s):
            pass
        if len(tour.stops) == 1:
            return first
        tour.shorten()
        stops = [prospect.stops[int(prospect.reachable[row])] for row in tour.stops]
        reason = f"first of a tour of {len(stops)} stops that lowers the variance most in {tour.time_s:.0f} s"
        return Choice(stops[0], reason, tuple(stops[1:]))


class _Tour:
    """A tour under construction; stops are rows of the prospect's worth."""

    def __init__(self, prospect: Prospect, first: int) -> None:
        self._prospect = prospect
        self._model = prospect.model
        self._nodes = self._model.stop_nodes[prospect.reachable]
        self._from_start = prospect.worth.travel_s
        self._between: dict[int, Array] = {}
        self.stops = [first]
        self.dwell_s = {first: float(prospect.worth.dwell_s[first])}

    def legs(self, row: int) -> Array:
        """Travel times from a stop to all."""
        if row not in self._between:
            self._between[row] = self._prospect.travel_from(row)
        return self._between[row]

    @property
    def times(self) -> list[float]:
        """Travel time of each leg."""
        return [float(self._from_start[self.stops[0]]), *(float(self.legs(a)[b]) for a, b in pairwise(self.stops))]

    @property
    def time_s(self) -> float:
        """Time of the tour, dwells included [s]."""
        return sum(self.times) + sum(self.dwell_s.values())

    def insert(self, horizon_s: float) -> bool:
        """Insert the stop with the largest gain per second that fits.

        :param horizon_s: longest time of the tour [s]
        :returns: whether one fits
        """
        nodes, seconds = self.counted()
        prospect, model = self._prospect, self._model
        each = [self._left(property_model, nodes, seconds) for property_model in (model, *model.others)]
        gain, variance, noise = (np.array(values) for values in zip(*each, strict=True))
        # where each candidate lengthens the tour least
        before = np.array([self._from_start, *(self.legs(row) for row in self.stops)])
        after = np.array([*(self.legs(row) for row in self.stops), np.zeros(len(self._nodes))])
        detour = before + after - np.append(self.times, 0.0)[:, None]
        position = np.argmin(detour, axis=0)
        extra_s = np.maximum(detour[position, np.arange(len(position))], 1e-6)
        # What is counted on the detour is worth about as much as counts at the stop for half the time.
        counted = np.minimum(0.5 * extra_s, MAX_ON_DETOUR_S) if prospect.counts_on_way else np.zeros(len(extra_s))
        on_way = gain * counted / (variance * counted + noise)
        # After these counts both A and B of the stop are smaller.
        less = noise / (variance * counted + noise)
        longest_s = np.full(len(extra_s), MAX_DWELL_S)
        dwell_s, value = best_dwell(on_way, gain * less**2, variance * less, noise, extra_s, longest_s)
        fits = self.time_s + extra_s + dwell_s <= horizon_s
        fits[self.stops] = False
        fits[prospect.reachable == prospect.staying] = False  # a tour is about going
        if not fits.any():
            return False
        row = int(np.argmax(np.where(fits, value, -np.inf)))
        self.stops.insert(int(position[row]), row)
        self.dwell_s[row] = float(dwell_s[row])
        return True

    def _left(self, model: PlanningModel, nodes: Indices, seconds: Array) -> tuple[Array, Array, Array]:
        """A, B and noise n of each stop after counts at some nodes."""
        stops = self._nodes
        noisy = model.covariance[np.ix_(nodes, nodes)] + np.diag(model.noise(nodes, seconds))
        across = model.covariance[np.ix_(nodes, stops)]
        # With counts on the way, the value of the stops has already computed the whole matrix.
        gram = model.gram[nodes] if self._prospect.counts_on_way else model.gram_of(nodes)
        # With V = (C_SS + N)^-1 C_Sx what is left is C_gx - C_gS V for each cell.
        v = np.linalg.solve(noisy, across)
        gain = model.gain[stops] + (v * (gram[:, nodes] @ v - 2 * gram[:, stops])).sum(axis=0)
        variance = model.covariance[stops, stops] - (across * v).sum(axis=0)
        noise = model.factor * model.rate[stops]
        return np.maximum(gain, 0.0), np.maximum(variance, 0.0) + model.nugget, noise

    def counted(self) -> tuple[Indices, Array]:
        """Nodes at which the tour counts, and the exposure at each [s]."""
        prospect = self._prospect
        nodes = [self._nodes[self.stops]]
        overhead_s = prospect.overhead_s
        seconds = [np.array([self.dwell_s[row] + overhead_s for row in self.stops])]
        if prospect.counts_on_way:
            place = prospect.position
            for row, leg in zip(self.stops, self.times, strict=True):
                way, each = prospect.way(place, row, leg)
                nodes.append(way)
                seconds.append(each)
                place = prospect.place(row)
        return np.concatenate(nodes), np.concatenate(seconds)

    def shorten(self) -> None:
        """2-opt and Or-opt of the open tour."""
        start_s = {row: float(self._from_start[row]) for row in self.stops}
        leg_s = {(a, b): float(self.legs(a)[b]) for a in self.stops for b in self.stops}

        def travel_s(stops: list[int]) -> float:
            return start_s[stops[0]] + sum(leg_s[leg] for leg in pairwise(stops))

        better = True
        while better:
            better = False
            length = travel_s(self.stops)
            for i in range(len(self.stops)):
                for j in range(i + 1, len(self.stops)):
                    old = self.stops
                    for new in (
                        [*old[:i], *old[i : j + 1][::-1], *old[j + 1 :]],
                        [*old[:i], *old[i + 1 : j + 1], old[i], *old[j + 1 :]],
                        [*old[:i], old[j], *old[i:j], *old[j + 1 :]],
                    ):
                        now = travel_s(new)
                        if now < length - 1e-6:
                            length, self.stops, better = now, new, True
