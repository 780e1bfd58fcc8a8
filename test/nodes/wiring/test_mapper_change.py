# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The change of a mapper's field since an earlier survey."""

import threading
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest

pytest.importorskip("rclpy")

from msg_adapters.soil_map import change_from_message
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.mapping.knowledge.earlier import EarlierSurvey
from soilmoist_ros.mapping.samples.samples import as_samples
from soilmoist_ros.mapping.soil_map import make_soil_map
from soilmoist_ros.mapping.variogram.model import Variogram
from soilmoist_ros.nodes.wiring.mapper_change import ChangeOutput
from soilmoist_ros.pipeline.run import EarlierRun

SAMPLES = as_samples([(2.0, 2.0), (10.0, 5.0), (18.0, 18.0)], [50, 60, 40], [10.0, 10.0, 10.0])
EARLIER = EarlierRun(EarlierSurvey("may", 0.0, SAMPLES), Path("may"), 0.0, [])


def survey(west_m):
    """A field with an earlier survey."""
    east_m = west_m + 20
    grid = FieldGrid.from_polygon([(west_m, 0), (east_m, 0), (east_m, 20), (west_m, 20)], cell_m=5.0)
    return SimpleNamespace(earlier=[EARLIER], map=SimpleNamespace(grid=grid))


def soil_map(of):
    return make_soil_map(SAMPLES, of.map.grid, Variogram("matern32", 0.01, 10.0, 0.3))


def test_a_map_that_waits_when_its_field_is_left_has_no_change():
    left, chosen, first, published = survey(0), survey(100), threading.Event(), []
    node = MagicMock()
    node.create_publisher.return_value.publish = lambda message: (published.append(message), first.set())
    output = ChangeOutput(node, left, "map")
    output.put(soil_map(left), 1e6)
    assert first.wait(20.0)
    output.put(soil_map(left), 2e6)  # waits until the pause after the first is over
    output.use(chosen)
    output.close()
    assert [message.header.stamp.sec for message in published] == [1_000_000]
    assert np.isfinite(change_from_message(published[0])["change_rate"]).all()
