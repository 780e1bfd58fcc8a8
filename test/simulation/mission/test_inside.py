# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated missions stay in the field and out of its no-go areas, whatever the graph."""

import json
import logging
from datetime import UTC, datetime

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rehearsal.cases import GRAPHS, OUTLINES, random_ground
from soilmoist_ros.exploration import STRATEGIES, Stop, TravelGraph, make_topological_map
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.simulation import MissionSettings, simulate_mission

POND = [[30, 25], [60, 25], [60, 60], [30, 60]]


def field_file(folder, polygon, no_go, cell_m=5.0):
    content = {
        "datum": {"latitude_deg": 53.0, "longitude_deg": -0.5}, "polygon": np.asarray(polygon, float).tolist(),
        "no_go": [np.asarray(ring, float).tolist() for ring in no_go], "cell_m": cell_m,
        "truth": {"formula": {"family": "texture", "low": 3.0, "high": 6.0}},
    }  # fmt: skip
    path = folder / "field.yaml"
    path.write_text(json.dumps(content))
    return path


def graph_file(folder, graph):
    path = folder / "graph.json"
    path.write_text(make_topological_map(graph, "map", datetime(2026, 1, 1, tzinfo=UTC)).to_json())
    return path


def pond_lattice():
    """Nodes 15 m apart that know nothing of the pond, four of them outside the field."""
    places = {(i, j): Stop(f"n{i}-{j}", 15.0 * i, 15.0 * j) for i in range(8) for j in range(6)}
    pairs = [(a, b) for a in places for b in places if 0 < max(abs(a[0] - b[0]), abs(a[1] - b[1])) <= 1]
    return TravelGraph.from_edges(list(places.values()), [(places[a].name, places[b].name) for a, b in pairs])


def outside_m(result, polygon, no_go):
    area = shapely.Polygon(polygon).difference(shapely.union_all([shapely.Polygon(ring) for ring in no_go]))
    area = area.buffer(1e-4)
    tracks = [shapely.LineString(track) for track in result.tracks if len(track) > 1]
    driven = sum(track.difference(area).length for track in tracks)
    return driven, [visit.name for visit in result.visits if not shapely.intersects_xy(area, visit.x_m, visit.y_m)]


@pytest.mark.slow
@pytest.mark.parametrize("strategy", STRATEGIES.names())
def test_no_strategy_drives_into_the_pond_or_out_of_the_field(tmp_path, caplog, strategy):
    polygon = [[0, 0], [95, 0], [95, 76], [0, 76]]
    settings = MissionSettings(
        field=str(field_file(tmp_path, polygon, [POND])), strategy=strategy, dwell="fmi:40", hours=0.4, seed=3,
        travel="graph", graph=str(graph_file(tmp_path, pond_lattice())), weather=False, position_sd_m=0.0,
    )  # fmt: skip
    with caplog.at_level(logging.WARNING):
        result = simulate_mission(settings)
    assert len(result.visits) >= 3
    assert outside_m(result, polygon, [POND]) == (0.0, [])
    (said,) = [record.message for record in caplog.records if "topological map" in record.message]
    assert "2 in a no-go area (n3-2, n3-3)" in said
    assert "n7-0" in said


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(
    st.integers(0, 10**6), st.sampled_from(OUTLINES), st.sampled_from([*GRAPHS, "laid", None]),
    st.sampled_from(STRATEGIES.names()), st.integers(1, 2),
)  # fmt: skip
def test_random_fields_and_graphs(tmp_path_factory, seed, outline, graph, strategy, robots):
    folder = tmp_path_factory.mktemp("ground")
    ground = random_ground(np.random.default_rng(seed), outline, None if graph == "laid" else graph)
    polygon, no_go = ground.field.polygon, ground.field.no_go
    file = None if ground.graph is None else str(graph_file(folder, ground.graph))
    wanted = MissionSettings(
        field=str(field_file(folder, polygon, no_go, ground.field.cell_m)), strategy=strategy, dwell="fmi:40",
        hours=0.12, seed=seed, travel="free" if graph is None else "graph", graph=file, weather=False,
        position_sd_m=0.0, robots=robots,
    )  # fmt: skip
    try:
        result = simulate_mission(wanted)
    except InputError:
        assume(False)  # the lattice of the simulator would have a single node
    assert outside_m(result, polygon, no_go) == (0.0, [])
