# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fields, travel maps and forecasts for the page Plan (work.py)."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from soilmoist_ros.console.plan.work import check_field, field_text, forecast, travel_map
from soilmoist_ros.exploration.travel.topological_map import read_topological_map
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.field import load_field

DATUM = [53.268, -0.5245]
FIELD = {"name": 'A "field": x', "datum": DATUM, "boundary": [[0, 0], [40, 0], [40, 30], [0, 30]]}
HOLE = [[10, 10], [20, 10], [20, 20]]


def test_what_is_drawn_becomes_a_field_file(tmp_path):
    answer = check_field({**FIELD, "no_go": [HOLE]})
    assert answer["area_m2"] == 40 * 30 - 50
    path = tmp_path / "field.yaml"
    path.write_text(answer["file"], encoding="utf-8")
    field = load_field(path)
    assert field.name == 'A "field": x'
    assert field.polygon.tolist() == FIELD["boundary"]
    assert [area.tolist() for area in field.no_go] == [HOLE]
    assert answer["note"] == ""
    across = [[[19, 1], [21, 1], [21, 40], [19, 40]]]
    answer = check_field({**FIELD, "no_go": across})
    assert answer["area_m2"] == 40 * 30 - 2 * 29, "without what lies over the border"
    assert "divide the field into 2 parts" in answer["note"]
    with pytest.raises(InputError, match=r"no-go area 1 encloses .* less than 1 m2"):
        check_field({**FIELD, "no_go": [[[1, 1], [1.5, 1], [1.5, 1.5]]]})
    with pytest.raises(InputError, match="not a simple polygon"):
        check_field({**FIELD, "boundary": [[0, 0], [40, 30], [40, 0], [0, 30]]})
    assert field_text({**FIELD, "name": ""}).startswith('name: "drawn field"\n')


@pytest.mark.slow
def test_a_longer_mission_makes_a_better_map():
    answer = forecast({**FIELD, "hours": 0.5, "variation": 0.2})
    times, errors = zip(*answer["points"], strict=True)
    assert times == tuple(sorted(times))
    assert max(times) == 1800
    assert 0 < errors[-1] < errors[0] < 0.6
    assert answer["stops"] > 5
    assert answer["distance_m"] > 50
    for wrong in ({"hours": 100}, {"variation": 7}, {"strategy": "none", "hours": 0.1}):
        with pytest.raises(InputError):
            forecast({**FIELD, **wrong})


@pytest.mark.slow
def test_stops_in_rows_or_a_lattice_are_a_map_for_the_navigation(tmp_path):
    for stops, count in (({"kind": "lattice", "spacing_m": 10}, 12), ({"kind": "rows", "rows_m": 10}, 12)):
        answer = travel_map({**FIELD, "stops": stops})
        (tmp_path / "map.yaml").write_text(answer["file"])
        graph = read_topological_map(tmp_path / "map.yaml").graph
        assert len(graph.stops) >= count / 2
        assert str(len(graph.stops)) in answer["summary"]
    with pytest.raises(InputError):
        travel_map({**FIELD, "stops": {"kind": "lattice", "spacing_m": 1000}})


@pytest.mark.slow
def test_a_forecast_ends_early_and_drives_on_rows():
    rows = {"kind": "rows", "rows_m": 6, "spacing_m": 8}
    answer = forecast({**FIELD, "hours": 0.4, "stops": rows, "strategy": "random", "dwell": "fmi:30"})
    early = forecast(
        {**FIELD, "hours": 0.4, "stops": rows, "strategy": "random", "dwell": "fmi:30", "until_sd": 0.5}
    )
    assert early["ends_s"] < answer["ends_s"] <= 0.4 * 3600


@pytest.mark.slow
def test_it_is_a_process_that_answers_with_json():
    for given, key in (
        ({"task": "field", **FIELD}, "file"),
        ({"task": "field"}, "error"),
        ({"task": "x"}, "error"),
        ({"task": "field", **FIELD, "no_go": [[[900, 10], [910, 10], [910, 20]]]}, "error"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "soilmoist_ros.console.plan.work"],
            input=json.dumps(given), capture_output=True, text=True, timeout=100, check=True,
        )  # fmt: skip
        assert key in json.loads(done.stdout)
    assert json.loads(done.stdout)["error"].startswith("no-go area 1 lies "), "no name of a temporary file"
