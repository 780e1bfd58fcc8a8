# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The simulator as an independent witness: where the robot truly is, and which goals reach its navigation.

Each is a line of the file SOILMOIST_WITNESS: time since the start [s], place [m], and the name if it is a goal.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any
from unittest.mock import patch

from soilmoist_ros.nodes import field_simulator
from soilmoist_ros.simulation import Output, SimulatedRobot, system


class WitnessedRobot(SimulatedRobot):
    """Writes down what it does and is asked for."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._graph = given[3].graph
        self._file = Path(os.environ["SOILMOIST_WITNESS"]).open("w", buffering=1)  # noqa: SIM115

    def step(self, now_s: float) -> list[Output]:
        out = super().step(now_s)
        self._write(*self.body.at(now_s))
        return out

    def go_to(self, target: str) -> int | None:
        if target in self._graph.names:
            self._write(*self._graph.xy[self._graph.index(target)].tolist(), target)
        return super().go_to(target)

    def go_to_pose(self, xy: tuple[float, float]) -> int | None:
        self._write(*xy, "pose")
        return super().go_to_pose(xy)

    def _write(self, *what: float | str) -> None:
        self._file.write(json.dumps([self.now_s, *what]) + "\n")


if __name__ == "__main__":
    with patch.object(system, "SimulatedRobot", WitnessedRobot):
        field_simulator.main()
