# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rehearsals by number: a seed and a number make a field, a navigator, a strategy and faults."""

from __future__ import annotations

import numpy as np

from soilmoist_ros.exploration.strategies.registry import BUILT_IN
from soilmoist_ros.simulation.rehearsal.faults import Fault, Faults, random_faults
from soilmoist_ros.simulation.rehearsal.ground import GRAPHS, OUTLINES, random_ground
from soilmoist_ros.simulation.rehearsal.world import NAVIGATORS, Case

NO_FAULT_EACH = 12
"""One in so many rehearsals has no fault."""


def make_case(seed: int, number: int) -> Case:
    """A rehearsal; three in a row, one of each navigator, share their field.

    Strategies and first faults take turns, so that each navigator meets each of them.

    :param seed: seed of all rehearsals
    :param number: of this one, from 0
    """
    field, turn = divmod(number, len(NAVIGATORS))
    ground_rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0, field)))
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1, number)))
    navigator = NAVIGATORS[turn]
    outline = OUTLINES[field % len(OUTLINES)]
    on_graph = navigator == "goto_node" or rng.uniform() < 0.3
    graph = GRAPHS[int(ground_rng.integers(len(GRAPHS)))]
    ground = random_ground(ground_rng, outline, graph if on_graph else None)
    kinds = list(Fault)
    first = None if number % NO_FAULT_EACH == NO_FAULT_EACH - 1 else kinds[(field * 5 + turn) % len(kinds)]
    strategies = list(BUILT_IN)
    budget_s = 900.0
    faults = random_faults(rng, first, int(rng.integers(3)) if first is not None else 0, 0.7 * budget_s)
    if navigator == "goal_pose":  # its standstill is guessed from positions: one that repeats looks like it
        faults = Faults([span for span in faults.spans if span.fault is not Fault.FIX_FROZEN])
    return Case(
        ground=ground,
        navigator=navigator,
        strategy=strategies[(field + 2 * turn) % len(strategies)],
        faults=faults,
        seed=seed * 1_000_003 + number,
        budget_s=budget_s,
        home=bool(rng.uniform() < 0.7),
    )
