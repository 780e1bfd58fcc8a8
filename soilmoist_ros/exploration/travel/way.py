# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The route of a goal, as it goes to a navigator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.travel.stop import Stop

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Way:
    """A route that the fence allows.

    :param corners: corners from the robot's place to the stop, both included, shape (p, 2) [m]; way points for a
        navigation that takes poses
    :param nodes: nodes to send one after the other to a navigation that takes names, the stop last. There is more
        than one where the navigation's own route to the stop would leave the fence; empty without a travel graph
    :param choices: straight lines of which a navigation that plans its own route may take any, shape (k, 2, 2)
        [m]; ``None`` where it takes the corners
    """

    corners: Array
    nodes: tuple[Stop, ...] = ()
    choices: Array | None = None

    @property
    def lines(self) -> Array:
        """Straight lines that the robot may follow, shape (k, 2, 2) [m]."""
        return np.stack([self.corners[:-1], self.corners[1:]], axis=1) if self.choices is None else self.choices
