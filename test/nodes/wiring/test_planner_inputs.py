# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the planner takes from the messages of the mapper."""

from unittest.mock import MagicMock

import numpy as np
import pytest

pytest.importorskip("rclpy")

from msg_adapters.model import Model, model_to_message
from soilmoist_ros.mapping.knowledge.drift import Change, Changing, Drift, TimedSamples
from soilmoist_ros.mapping.samples.samples import as_samples
from soilmoist_ros.mapping.variogram.fit import estimate_variogram
from soilmoist_ros.nodes.wiring.planner_inputs import PlannerInputs

SAMPLES = as_samples([(2.0, 2.0), (10.0, 5.0), (18.0, 18.0)], [50, 60, 40], [10.0, 10.0, 10.0])
FIT = estimate_variogram(SAMPLES.xy, SAMPLES.counts, SAMPLES.exposure_s, extent_m=20.0)


@pytest.mark.parametrize("drift", [None, Drift(0.9, False, (0.0, 90.0), (-0.1, 0.0), ((0.02, 0.0),))])
def test_the_drift_of_a_model_reaches_the_control(drift):
    node, control = MagicMock(), MagicMock()
    PlannerInputs(node, control, MagicMock(), map_topic="")
    receive = {call.args[1]: call.args[2] for call in node.create_subscription.call_args_list}
    times_s = np.array([0.0, 40.0, 80.0])
    changing = None if drift is None else Changing(TimedSamples(SAMPLES, times_s), Change(drift), 90.0)
    receive["model"](model_to_message(Model(FIT, 90.0, 2.0, changing)))
    fit, stamp_s, name, cell_m, found = control.fit.call_args.args
    assert (fit.variogram, stamp_s, name, cell_m) == (FIT.variogram, 90.0, "", 2.0)
    assert (None if found is None else found.change.drift) == drift
