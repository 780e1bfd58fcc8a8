# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Places in words."""

from __future__ import annotations

import sys

import pytest

from soilmoist_ros.foundation.places import coordinates_text, direction, distance_text, place_text, town_text

LINCOLN = (53.268, -0.5245)


@pytest.mark.parametrize(
    ("bearing_deg", "name"), [(0, "north"), (22, "north"), (23, "north-east"), (350, "north")]
)
def test_directions(bearing_deg, name):
    assert direction(bearing_deg) == name


def test_distances_have_the_unit_that_people_use():
    texts = [distance_text(metres) for metres in (3.4, 999.0, 1499.0, 12_345.0, 7_012_000.0)]
    assert texts == ["3 m", "999 m", "1.5 km", "12 km", "7,012 km"]


def test_coordinates_have_letters_for_signs():
    assert coordinates_text(-33.9, 18.4, 1) == "33.9 S, 18.4 E"


@pytest.mark.slow
def test_the_nearest_town():
    pytest.importorskip("reverse_geocode")
    assert place_text(LINCOLN) == "53.27 N, 0.52 W, near Nettleham (England, United Kingdom)"
    assert town_text((0.0, -30.0)).startswith("502 km north-east of Fernando de Noronha")


def test_without_the_gazetteer_there_are_coordinates(monkeypatch):
    monkeypatch.setitem(sys.modules, "reverse_geocode", None)
    assert place_text((53.2681, -0.5245)) == "53.27 N, 0.52 W"
