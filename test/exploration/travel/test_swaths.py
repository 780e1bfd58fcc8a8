# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Swaths of coverage planners as travel graphs (travel/swaths.py)."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.exploration.travel.swaths import swath_graph
from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import Field

FRAME = LocalFrame(52.0, 5.0)
FIELD = Field("hundred", FRAME, np.array([[-10, -10], [110, -10], [110, 40], [-10, 40]], float))
SWATHS = [((0.0, 0.0), (100.0, 0.0)), ((100.0, 10.0), (0.0, 10.0)), ((0.0, 20.0), (100.0, 20.0))]


def geojson(folder, degrees=False):
    """As data/swaths.geojson of Fields2Cover, and data/workinglanes.geojson of its earlier versions."""
    lines = [FRAME.to_geographic(line)[:, ::-1].tolist() if degrees else line for line in SWATHS]
    features = [
        {"properties": {"path_id": 44 + n, "width": 0.3}, "geometry": {"type": "LineString", "coordinates": line}}
        for n, line in enumerate(lines)
    ]
    (folder / "swaths.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return folder / "swaths.geojson"


def bend(number):
    """Places of the turn between two swaths: half a circle."""
    x_m, y_m = SWATHS[number][1]
    side = 1.0 if x_m > 50 else -1.0
    at = np.linspace(-math.pi / 2, math.pi / 2, 9)
    return [(x_m + side * 5 * math.cos(a), y_m + 5 + 5 * math.sin(a)) for a in at]


def components(folder):
    """As ros2 topic echo prints PathComponents of opennav_coverage."""
    point = "{{x: {0}, y: {1}, z: 0.0}}"
    text = "header: {frame_id: WGS 84 / UTM zone 32N}\nswaths:\n"
    for start, end in SWATHS:
        text += f"- start: {point.format(*start)}\n  end: {point.format(*end)}\n"
    poses = ["".join(f"  - pose: {{position: {point.format(*at)}}}\n" for at in bend(n)) for n in range(2)]
    text += "turns:\n" + "".join(f"- header: {{frame_id: map}}\n  poses:\n{one}" for one in poses)
    (folder / "path.yaml").write_text(f"{text}contains_turns: true\nswaths_ordered: true\n---\n")
    return folder / "path.yaml"


@pytest.mark.parametrize("degrees", [False, True])
def test_swaths_without_turns_are_joined_through_the_headland(tmp_path, degrees):
    built, said = swath_graph(FIELD, geojson(tmp_path, degrees), 25.0, 1.0)
    graph = built.graph
    assert f"{'degrees' if degrees else 'metres'}), joined by 4 straight ways" in said
    assert len(graph.names) == 3 * 5
    assert list(graph.path("swath44-3", "swath45-1"))[1:-1] == ["swath44-end", "swath45-start"]
    pond = replace(FIELD, no_go=(np.array([[98, 3], [104, 3], [104, 7], [98, 7]], float),))
    built, said = swath_graph(pond, geojson(tmp_path), 25.0, 1.0)
    assert "1 others would leave the field or cross a no-go area (swath44-end - swath45-start)" in said
    assert built.graph.path("swath44-end", "swath45-start")[1] == "swath44-3", "the robot drives back"


def test_turns_of_the_file_join_its_swaths(tmp_path):
    file = components(tmp_path)
    built, said = swath_graph(FIELD, file, 50.0, 1.0)
    assert "joined by 2 turns of the file" in said
    way = built.graph.path("swath1-end", "swath2-start")
    assert max(built.graph.xy[[built.graph.index(name) for name in way], 0]) == pytest.approx(105.0, abs=0.2)
    narrow = replace(FIELD, polygon=np.array([[-10, -10], [103, -10], [103, 40], [-10, 40]], float))
    assert "1 others would leave the field" in swath_graph(narrow, file, 50.0, 1.0)[1]
    short = replace(FIELD, polygon=np.array([[-10, -10], [110, -10], [110, 14], [-10, 14]], float))
    said = swath_graph(short, file, 50.0, 1.0)[1]
    assert said.startswith("2 swaths")
    assert said.endswith("; swath 3 lies outside the field: not used")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"features": [{"geometry": {"type": "Polygon", "coordinates": []}}]}', "has no swath"),
        (
            '{"features": [{"geometry": {"type": "LineString", "coordinates": [[5.0, null], [5, 6]]}}]}',
            "not finite",
        ),
        ("<GAOS_parcel><Row id='1'/></GAOS_parcel>", "has no swath"),
        ("swaths:\n- start: {x: 0, y: 0}\n", "lacks 'end'"),
        ("0 5000 0 0 1 10 1 1\n", "has no swath"),  # a path of Fields2Cover
        *(
            (
                f"header: {{frame_id: '{frame}'}}\nswaths: [{{start: {{x: 5, y: 9}}, end: {{x: 6, y: 9}}}}]",
                "in degrees",
            )
            for frame in ("EPSG:4326", "EPSG:4258", "WGS84")
        ),
        ('{"features": ', "is not valid JSON"),
        (
            "swaths: [{start: {x: 0, y: 5000}, end: {x: 10, y: 5000}}]",
            "most of its places are not in the field 'hundred': the nearest is 5.0 km away",
        ),
    ],
)
def test_other_files_are_refused_in_words(tmp_path, text, said):
    (tmp_path / "swaths").write_text(text)
    with pytest.raises(InputError, match=said):
        swath_graph(FIELD, tmp_path / "swaths", 10.0, 1.0)
