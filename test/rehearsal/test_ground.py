# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Random fields and graphs: ``ground.py``."""

import numpy as np
import pytest
import shapely

from rehearsal.cases import GRAPHS, OUTLINES, random_ground


@pytest.mark.parametrize("outline", OUTLINES)
@pytest.mark.parametrize("graph", [None, *GRAPHS])
def test_a_robot_can_begin(outline, graph):
    ground = random_ground(np.random.default_rng(3), outline, graph)
    area = shapely.Polygon(ground.field.polygon)
    assert area.is_valid
    no_go = shapely.union_all([shapely.Polygon(ring) for ring in ground.field.no_go])
    assert area.difference(no_go).covers(shapely.Point(ground.start))
    assert (ground.graph is None) == (graph is None)
    assert ground.field.grid().mask.sum() > 20


def test_wild_graphs_know_nothing_of_the_field():
    ground = random_ground(np.random.default_rng(5), "holes", "wild")
    area = shapely.Polygon(ground.field.polygon)
    assert not area.covers(shapely.MultiPoint(ground.graph.xy))


def test_islands_are_not_joined():
    ground = random_ground(np.random.default_rng(5), "convex", "islands")
    assert ground.graph.components().max() >= 1
