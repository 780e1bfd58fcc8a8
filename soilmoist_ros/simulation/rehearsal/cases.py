# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rehearsals by number: a seed and a number make a field, a navigator, a strategy and faults."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilmoist_ros.exploration import BUILT_IN
from soilmoist_ros.simulation.rehearsal.faults import Fault, Faults, random_faults
from soilmoist_ros.simulation.rehearsal.ground import GRAPHS, OUTLINES, ROWS, random_ground
from soilmoist_ros.simulation.rehearsal.receiver import RECEIVERS
from soilmoist_ros.simulation.rehearsal.world import NAVIGATORS, STATED, Case

NO_FAULT_EACH = 12
"""One in so many rehearsals has no fault."""
QUIET_HZ = (1.0, 0.5, 5.0, 1.0, 0.5, 10.0)
"""Fixes in a second of missions without faults, in turn; many take long."""
QUIET_STRATEGIES = ("random", "greedy")
FIXES_HZ = (1.0, 1.0, 0.5, 1.0, 5.0)
"""Fixes in a second, by the number of the field."""


def make_case(seed: int, number: int, fault: Fault | None = None) -> Case:
    """A rehearsal; three in a row, one of each navigator, share their field.

    Strategies and first faults take turns, so that each navigator meets each of them.

    :param seed: seed of all rehearsals
    :param number: of this one, from 0
    :param fault: its only fault, apart from commands of people that come with it; drawn if left out
    """
    field, turn = divmod(number, len(NAVIGATORS))
    ground_rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0, field)))
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1, number)))
    navigator = NAVIGATORS[turn]
    outline = OUTLINES[field % len(OUTLINES)]
    on_graph = navigator == "goto_node" or rng.uniform() < 0.3
    graph = GRAPHS[int(ground_rng.integers(len(GRAPHS)))]
    kinds = list(Fault)
    firsts = (
        [fault] * len(NAVIGATORS)
        if fault is not None
        else [kinds[(field * 5 + each) % len(kinds)] for each in range(len(NAVIGATORS))]
    )
    ponds_rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2, field)))
    ponds = 2 if field % 4 == 0 or Fault.DETOUR in firsts else 0
    graph = ROWS if Fault.NEIGHBOUR in firsts else graph
    ground = random_ground(ground_rng, outline, graph if on_graph else None, ponds, ponds_rng)
    none = fault is None and number % NO_FAULT_EACH == NO_FAULT_EACH - 1
    first = None if none else firsts[turn]
    strategies = list(BUILT_IN)
    budget_s = 900.0
    faults = random_faults(
        rng, first, int(rng.integers(3)) if first is not None and fault is None else 0, 0.7 * budget_s
    )
    if navigator == "goal_pose":  # its standstill is guessed from positions: one that repeats looks like it
        drawn = {span.fault for span in faults.spans}
        # a robot that never arrives, and cannot be stopped, does not show whether it or its place moves
        wrong = {Fault.FIX_FROZEN, *((Fault.FIX_DRIFT,) if Fault.OTHER_MAP in drawn else ())}
        faults = Faults([span for span in faults.spans if span.fault not in wrong])
    return Case(
        ground=ground,
        navigator=navigator,
        strategy=strategies[(field + 2 * turn) % len(strategies)],
        faults=faults,
        seed=seed * 1_000_003 + number,
        budget_s=budget_s,
        home=bool(rng.uniform() < 0.7),
        fixes_hz=FIXES_HZ[field % len(FIXES_HZ)],
        stated=STATED[(field + turn) % len(STATED)],
    )


def make_quiet_case(seed: int, number: int) -> Case:
    """A mission of an hour without faults; receivers, their rates and what they state take turns.

    :param seed: seed of all missions
    :param number: of this one, from 0
    """
    turn, receiver = divmod(number, len(RECEIVERS))
    turn, rate = divmod(turn, len(QUIET_HZ))
    case = make_case(seed, number + turn)  # each receiver and rate with each navigator
    return replace(
        case,
        faults=Faults(),
        budget_s=3600.0,
        strategy=QUIET_STRATEGIES[number % len(QUIET_STRATEGIES)],
        receiver=tuple(RECEIVERS)[receiver],
        fixes_hz=QUIET_HZ[rate],
        stated=STATED[(number // 7) % len(STATED)],
    )
