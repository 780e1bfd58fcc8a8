# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A recording has the datum of its own field file, whatever field is mapped: recorded_place.py."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.field import load_field
from soilmoist_ros.pipeline import ReplaySettings, replay_bag
from soilmoist_ros.pipeline.properties import RecordedPlaces, recorded_places

GOLDEN = Path(__file__).resolve().parents[1] / "golden" / "one_stop"
FIELD = load_field(GOLDEN / "configuration" / "field.yaml")


def field_file(folder, frame, polygon):
    path = folder / "field.yaml"
    datum = f"datum: {{latitude_deg: {frame.latitude_deg!r}, longitude_deg: {frame.longitude_deg!r}}}\n"
    path.write_text(f"name: other\n{datum}polygon: {np.asarray(polygon).tolist()}\n")
    return path


@pytest.mark.slow
def test_a_field_with_another_datum_is_mapped_where_the_robot_was(tmp_path):
    latitude, longitude = FIELD.frame.to_geographic([(400.0, -300.0)])[0]
    frame = LocalFrame(float(latitude), float(longitude))
    polygon = frame.to_local(*FIELD.frame.to_geographic(FIELD.polygon).T)
    moved = replay_bag(GOLDEN, ReplaySettings(field=str(field_file(tmp_path, frame, polygon)), cell_m=4.0)).run
    there = replay_bag(GOLDEN, ReplaySettings(cell_m=4.0)).run
    assert moved.inside == there.inside
    for one, other in zip(moved.track, there.track, strict=True):
        known = FIELD.frame.to_geographic([(other.x_m, other.y_m)])
        np.testing.assert_allclose(frame.to_geographic([(one.x_m, one.y_m)]), known, atol=1e-9)


def test_a_field_elsewhere_is_refused(tmp_path):
    path = field_file(tmp_path, LocalFrame(53.268, 0.5245), FIELD.polygon)
    with pytest.raises(
        InputError, match=r"All 14 records lie at least 70 km west .* Correct the sign of the longitude"
    ):
        replay_bag(GOLDEN, ReplaySettings(field=str(path)))


def test_visits_are_converted_with_their_stops():
    other = dataclasses.replace(FIELD, frame=LocalFrame(53.269, -0.5245))
    (moved,) = RecordedPlaces(FIELD.frame, other).visits([Visit("a", 5.0, 6.0, 0.0, 1.0, 3, "why")])
    assert (moved.x_m, moved.y_m) == pytest.approx((5.0, 6.0 - 111.3), abs=0.1)
    assert np.isnan(moved.stop_x_m)


def test_without_a_configuration_the_places_are_those_of_the_field(tmp_path):
    assert recorded_places(None, FIELD).recorded == FIELD.frame
    assert recorded_places(GOLDEN / "configuration", FIELD).recorded == FIELD.frame


def test_a_field_on_the_other_side_of_the_earth_is_refused(tmp_path):
    path = field_file(tmp_path, LocalFrame(-53.268, -0.5245), FIELD.polygon)
    with pytest.raises(
        InputError, match=r"all 14 records lie 11,8\d\d km north .* correct the sign of the latitude"
    ):
        replay_bag(GOLDEN, ReplaySettings(field=str(path)))
