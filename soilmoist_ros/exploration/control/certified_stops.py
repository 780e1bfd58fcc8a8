# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Certified stops: a sealed sample that every strategy's plan takes in, while the strategy knows nothing of it.

What is stated about a map by a random sample holds whatever the model, if the map does not depend on the
sample. So the strategy never hears of the certified stops: it chooses its next stop without their counts, and
where a certified stop lies on the way there, the robot counts at it first and then goes on to the stop that was
chosen.
"""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from soilmoist_ros.exploration.control.explorer import Explorer
from soilmoist_ros.exploration.control.team import PendingMeasurement
from soilmoist_ros.exploration.mission.events import Planned, RequestPlan
from soilmoist_ros.exploration.mission.types import MissionRules
from soilmoist_ros.exploration.planning.dwell import FixedInterval
from soilmoist_ros.exploration.planning.sealed_sample import (
    MIN_PLACES,
    SealedSample,
    draw_sample,
    sample_from_text,
)
from soilmoist_ros.exploration.strategies.route import nearest_neighbour
from soilmoist_ros.exploration.strategies.strategy import Choice
from soilmoist_ros.exploration.travel.stop import Stop, inside_any
from soilmoist_ros.exploration.travel.travel import RobotMotion
from soilmoist_ros.foundation import InputError

Place = tuple[float, float]

TIME_SHARE = 0.05
"""Share of the mission time for counting at certified stops. More shortens the intervals, and costs the map."""
MIN_RECORDS = 2  # least number of records at a certified stop
DETOUR_SHARE = 0.25  # detour to a certified stop, relative to the way from one to the next; for the time to keep
COVERS = 0.6  # a tour that takes this share of the time left is the last one: stops are inserted where cheapest
MAX_SHARE = 1 / 3  # share of the mission time that the certified stops may take


def check_time(
    count: int, area_m2: float, motion: RobotMotion, rules: MissionRules, cadence_s: float = 10.0
) -> None:
    """Refuse a certificate in a field of some area whose places would take over a third of the mission time.

    :raises InputError: says how many places would not
    """

    def each_s(places: int) -> float:
        detour_s = DETOUR_SHARE * math.sqrt(area_m2 / places) / motion.speed_mps
        return max(MIN_RECORDS * cadence_s, rules.min_dwell_s) + cadence_s / 2 + motion.stop_overhead_s + detour_s

    max_s = MAX_SHARE * rules.budget_s
    if not count or count * each_s(count) <= max_s:
        return
    fit = next((n for n in range(min(count, int(max_s)), MIN_PLACES - 1, -1) if n * each_s(n) <= max_s), 0)
    hours, given = count * each_s(count) / 3600, rules.budget_s / 3600
    remedy = f"give at most {fit} places, or {math.ceil(hours / MAX_SHARE * 10) / 10:g} h" if fit else (
        f"give {math.ceil(MIN_PLACES * each_s(MIN_PLACES) / MAX_SHARE / 36) / 100:g} h or more, or leave it out"
    )  # fmt: skip
    raise InputError(f"certify: {count} places would take {hours:.2g} h of {given:.3g} h", remedy)


class CertifiedStops:
    """Takes the certified stops into the plans of one mission.

    :param count: number of places of the sample
    :param seal: makes the seed; its default cannot be foreseen
    """

    def __init__(self, count: int, seal: Callable[[], int] = lambda: secrets.randbits(53)) -> None:
        self._count, self._seal = count, seal
        self._next: Planned | None = None  # chosen by the strategy, and waits for a certified stop on the way

    def plan(
        self, explorer: Explorer, request: RequestPlan, place: Place, others: Sequence[PendingMeasurement]
    ) -> Planned:
        """The next stop: the strategy's, or a certified one before it."""
        sample = self._drawn(explorer, request, place)
        done = {request.staying, *(visit.name for visit in request.certified)}
        ruled_out = set(request.blacklisted)
        left = [stop for stop in dict.fromkeys(sample.stops) if stop.name not in done]
        usable = [
            stop
            for stop in left
            if stop.name not in ruled_out
            and not inside_any(request.ruled_out, stop.xy)[0]
            and explorer.fits(stop, place, request)
        ]
        kept_s = self._kept_s(explorer, place, usable, sample.dwell_s)
        planned = self._chosen(explorer, request, place, others, sample, kept_s)
        due = None if not usable else self._due(explorer, request, place, planned, usable, sample.dwell_s)
        if due is not None:
            self._next = planned if planned.choice is not None else None
            planned = self._to(explorer, request, place, due, sample)
        new = "" if request.certificate else sample.text
        return replace(planned, certificate=new, to_certify=len(usable))

    def _drawn(self, explorer: Explorer, request: RequestPlan, place: Place) -> SealedSample:
        """The sample of the mission, drawn with its first plan."""
        if request.certificate:
            return sample_from_text(request.certificate)
        cadence_s, overhead_s = explorer.counting.cadence_s, explorer.travel.motion.stop_overhead_s
        each_s = TIME_SHARE * request.time_left_s / self._count - overhead_s
        dwell_s = cadence_s * max(MIN_RECORDS, round(each_s / cadence_s))
        reached = np.isfinite(explorer.travel.travel_s(place, explorer.stops))
        min_s = max(dwell_s, explorer.rules.min_dwell_s)
        return draw_sample(explorer.grid, explorer.stops, reached, self._count, min_s, self._seal())

    def _chosen(
        self, explorer: Explorer, request: RequestPlan, place: Place, others: Sequence[PendingMeasurement],
        sample: SealedSample, kept_s: float,
    ) -> Planned:  # fmt: skip
        """Choice of the strategy in the time that the certified stops leave; its last one, if that waits."""
        waiting, self._next = self._next, None
        hidden = replace(request, blacklisted=(*request.blacklisted, *sorted(sample.names)))
        if waiting is not None and waiting.choice is not None:
            stop = waiting.choice.stop
            if stop.name not in request.blacklisted and not inside_any(request.ruled_out, stop.xy)[0]:
                travel_s = float(explorer.travel.travel_s(place, [stop])[0])
                return replace(waiting, plan_id=request.plan_id, travel_s=travel_s)
        if kept_s and (request.certify_now or request.time_left_s <= kept_s):
            return Planned(0.0, request.plan_id, None)
        shorter = replace(
            hidden, time_left_s=request.time_left_s - kept_s, budget_left_s=request.budget_left_s - kept_s
        )
        return explorer.choose(shorter, place, others)

    def _kept_s(self, explorer: Explorer, place: Place, stops: Sequence[Stop], dwell_s: float) -> float:
        """Time to keep for certified stops that lie on the way [s]."""
        if not stops:
            return 0.0
        overhead_s = explorer.travel.motion.stop_overhead_s
        detours_s = DETOUR_SHARE * (_tour_s(explorer, place, stops) - len(stops) * overhead_s)
        return len(stops) * (dwell_s + overhead_s + explorer.counting.cadence_s / 2) + detours_s

    def _due(
        self, explorer: Explorer, request: RequestPlan, place: Place, planned: Planned, left: Sequence[Stop],
        dwell_s: float,
    ) -> Stop | None:  # fmt: skip
        """The certified stop to go to before what the strategy has chosen; ``None`` if none is due."""
        travel, choice = explorer.travel, planned.choice
        there_s = travel.travel_s(place, left)
        nearest = left[int(np.argmin(there_s))]
        if choice is None:
            return nearest
        each_s = dwell_s + explorer.counting.cadence_s
        rule = choice.dwell or explorer.rules.dwell
        counts_s = rule.expected_s(explorer.nominal_rate_cps)
        after_s = _tour_s(explorer, choice.stop.xy, left) + len(left) * each_s
        way_s = planned.travel_s or 0.0
        if way_s + counts_s + explorer.counting.cadence_s + after_s > request.time_left_s:
            return nearest
        if choice.stop.name == request.staying:
            return None
        path = [choice.stop, *choice.ahead]
        stops = (*path, *left)
        between_s = travel.between_s(stops, np.arange(len(stops)))
        to, away = between_s[: len(path), len(path) :], between_s[len(path) :, : len(path)].T
        legs_s = between_s.diagonal(1)[: len(path) - 1]
        first_s = there_s + away[0] - way_s
        later_s = (to[:-1] + away[1:] - legs_s[:, None]).min(axis=0, initial=math.inf)
        later_s = np.minimum(later_s, to[-1])
        if choice.ahead:
            lasts_s = float(legs_s.sum()) + way_s + len(path) * (counts_s + explorer.counting.cadence_s / 2)
            now = (first_s <= later_s) & (lasts_s >= COVERS * request.time_left_s)
        else:  # without a tour, one after the other, evenly over the time
            done = len(request.certified) + 1
            budget_s = request.time_used_s + request.time_left_s
            now = np.full(len(left), request.time_used_s >= budget_s * done / (self._count + 1))
        return left[int(np.argmin(np.where(now, first_s, np.inf)))] if now.any() else None

    @staticmethod
    def _to(explorer: Explorer, request: RequestPlan, place: Place, stop: Stop, sample: SealedSample) -> Planned:
        number = [one.name for one in sample.stops].index(stop.name) + 1
        reason = (
            f"certified place {number} of {len(sample.stops)}, drawn before the mission (seal {sample.digest})"
        )
        choice = Choice(stop, reason, (), FixedInterval(sample.dwell_s, 2 * sample.dwell_s), certifies=True)
        travel_s = float(explorer.travel.travel_s(place, [stop])[0])
        return Planned(0.0, request.plan_id, choice, travel_s, home_s=explorer.home_s(stop.name))


def _tour_s(explorer: Explorer, place: Place, stops: Sequence[Stop]) -> float:
    """Travel time of a tour through stops, each the nearest to the one before, overheads included [s]."""
    start_s = explorer.travel.travel_s(place, stops)
    between_s = explorer.travel.between_s(tuple(stops), np.arange(len(stops)))
    order = nearest_neighbour(start_s, between_s)
    return float(start_s[order[0]] + between_s[order[:-1], order[1:]].sum())
