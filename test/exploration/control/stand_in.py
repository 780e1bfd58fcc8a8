# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A field with a pond, and navigator and outputs of a mission control in one; tests override what matters."""

import math
from concurrent.futures import Executor, Future
from itertools import pairwise

import numpy as np

from soilmoist_ros.exploration import (
    ExplorerSettings,
    MissionRules,
    MissionSetup,
    RobotMotion,
    Stop,
    TravelGraph,
    parse_dwell,
)
from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.field import Field

SQUARE = np.array([[0, 0], [60, 0], [60, 40], [0, 40]], float)
POND = np.array([[20, 12], [40, 12], [40, 40], [20, 40]], float)
MEADOW = Field("meadow", LocalFrame(53.0, 0.0), SQUARE, (POND,), 4.0)
PLACES = {"a": (10, 20), "p": (30, 20), "b": (50, 20), "s": (10, 6), "t": (30, 6), "u": (50, 6)}
"""The pond of the meadow lies between a and b, with the node p in it; s, t and u lead around it."""


def graph(places, *ways, one_way=()):
    """A graph of ways such as ``a s t``, which lead there and back."""
    stops = [Stop(name, float(x), float(y)) for name, (x, y) in places.items()]
    both = [pair for way in ways for pair in pairwise(way.split())]
    edges = [*both, *((end, start) for start, end in both), *(tuple(way.split()) for way in one_way)]
    return TravelGraph.from_edges(stops, edges)


def square_setup(side_m, cell_m, strategy="random", no_go=(), settings=None, more=None, **rules):
    """A mission of a square field; further settings of the explorer and the setup, and rules."""
    corners = np.array([[0, 0], [side_m, 0], [side_m, side_m], [0, side_m]], float)
    chosen = {"strategy": strategy, "preset": "paper", "seed": 1, "motion": RobotMotion(1.0), **(settings or {})}
    given = {"budget_s": 7200.0, "dwell": parse_dwell("fmi:60"), "warm_up_stops": 0, "speed_mps": 1.0, **rules}
    return MissionSetup(
        field=Field("square", LocalFrame(53.0, 0.0), corners, no_go, cell_m), settings=ExplorerSettings(**chosen),
        rules=MissionRules(**given), **(more or {}),
    )  # fmt: skip


class AtOnce(Executor):
    """Plans in the thread that asks."""

    def submit(self, work, /, *args, **kwargs):
        work(*args, **kwargs)
        return Future()


class StandIn:
    waiting_for = on_the_way = caution = other_client = ""
    feedback_age_s = math.nan
    stop_unheard = False
    finished = None
    go = cancel = moved = tick = visit = wake = lambda self, *_: None

    def navigator(self, report):
        self.report = report
        return self

    def finish(self, finish):
        self.finished = finish

    def show(self, status, ahead, more):
        self.shown = status


class Driving(StandIn):
    """A robot that drives at 1 m/s along the way to its goal."""

    def __init__(self, place):
        self.place, self.way, self.goal_id, self.cancelled = place, [], None, 0

    def go(self, goal_id, stop, way):
        self.goal_id, self.way = goal_id, [tuple(corner) for corner in way.corners[1:].tolist()]

    def cancel(self, goal_id):
        self.cancelled += 1
        if self.goal_id is not None:
            self.goal_id, self.way = None, []
            self.report(Ended(goal_id, Outcome.CANCELED, "cancelled"))

    def move(self):
        """Drive for a second."""
        left_m = 1.0
        while self.way and left_m > 0:
            away_m = math.dist(self.place, self.way[0])
            share = min(1.0, left_m / away_m) if away_m else 1.0
            self.place = tuple(a + share * (b - a) for a, b in zip(self.place, self.way[0], strict=True))
            left_m -= away_m
            self.way = self.way[share == 1.0 :]

    def arrive(self):
        """Report the end of the way."""
        if self.goal_id is not None and not self.way:
            goal_id, self.goal_id = self.goal_id, None
            self.report(Ended(goal_id, Outcome.SUCCEEDED, "arrived"))
