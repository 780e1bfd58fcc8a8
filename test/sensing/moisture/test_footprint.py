# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import json
import math
from pathlib import Path

import numpy as np
import pytest
from crnpy import crnpy

from soilmoist_ros.sensing.moisture.footprint import Footprint, pressure_scale, sensed_soil, vegetation_scale

REFERENCE = json.loads((Path(__file__).parents[2] / "data" / "crns_reference.json").read_text())
STANDARD = pressure_scale(1013.25)


def test_weights_of_the_distance_agree_with_an_independent_implementation():
    for scaled_m, water, humidity, weight in REFERENCE["horizontal"]["rows"]:
        found = Footprint(water, humidity).weight(scaled_m * STANDARD)
        assert found == pytest.approx(weight, rel=1e-12)


def test_depth_and_rescaled_distance_agree_with_an_independent_implementation():
    for scaled_m, density, water, depth_cm in REFERENCE["depth"]["rows"]:
        found = Footprint(water).depth_at_cm(scaled_m * STANDARD, density)
        assert found == pytest.approx(depth_cm, rel=1e-12)
    for distance_m, pressure, height_m, water, scaled_m in REFERENCE["scaled_distance"]["rows"]:
        scale = pressure_scale(pressure) * vegetation_scale(height_m, water)
        assert distance_m / scale == pytest.approx(scaled_m, rel=1e-12)
    ours = Footprint(0.2, pressure_hpa=950.0).depth_at_cm([5.0, 50.0], 1.4)
    theirs = crnpy.sensing_depth(0.2, 950.0, 1013.25, 1.4, 0.0, dist=[5.0, 50.0])
    np.testing.assert_allclose(ours, theirs, rtol=1e-12)


def test_the_radius_is_that_of_the_published_table():
    """The table is rounded to metres and was made from the simulations; the fits differ by up to 3 %."""
    table = np.array(REFERENCE["radius"]["rows"])
    radius_m = [Footprint(water, humidity).radius_m for water, humidity, _ in table]
    np.testing.assert_allclose(radius_m, table[:, 2], rtol=0.03)
    middle = (table[:, 0] >= 0.1) & (table[:, 0] <= 0.3)
    np.testing.assert_allclose(np.array(radius_m)[middle], table[middle, 2], rtol=0.01)


@pytest.mark.parametrize("shield_radius_m", [math.inf, 60.0, 10.0, 2.0])
def test_closed_integrals_are_those_of_the_weights(shield_radius_m):
    footprint = Footprint(0.25, 8.0, 900.0, 1.0, shield_radius_m)
    distance_m = np.concatenate([[0], np.geomspace(1e-4, 4000, 400_001)])
    middle_m = (distance_m[1:] + distance_m[:-1]) / 2
    counts = footprint.weight(middle_m) * np.diff(distance_m)
    within = counts[middle_m <= footprint.radius_m].sum() / counts.sum()
    assert within == pytest.approx(0.86, abs=2e-4)
    assert footprint.radius_m == min(shield_radius_m, Footprint(0.25, 8.0, 900.0, 1.0).radius_m)
    # The depth is linear in exp(-r*/100 m): its mean over the counts is the depth at the mean of the exponential.
    mean_cm = float(counts @ footprint.depth_at_cm(middle_m, 1.4) / counts.sum())
    assert footprint.depth_cm(1.4) == pytest.approx(mean_cm, rel=1e-5)


def test_a_shield_takes_far_neutrons_only():
    bare, shielded = Footprint(0.2), Footprint(0.2, shield_radius_m=10.0)
    distance_m = np.array([0.1, 1.0, 10.0, 100.0])
    share = shielded.weight(distance_m) / bare.weight(distance_m)
    assert share[0] > 0.99
    assert np.all(np.diff(share) < 0)
    assert share[3] < 0.01
    assert Footprint(0.2, shield_radius_m=500.0).weight(distance_m) == pytest.approx(bare.weight(distance_m))


def test_the_sensed_soil_is_that_of_every_cell():
    air = Footprint(0.0, 8.0, 950.0)
    vwc = np.array([[0.1, 0.2], [np.nan, 0.4]])
    sensed = sensed_soil(vwc, 1.4, 0.05, air)
    cells = [Footprint(value + 0.07, 8.0, 950.0) for value in (0.1, 0.2, 0.4)]
    depth, radius = [cell.depth_cm(1.4) for cell in cells], [cell.radius_m for cell in cells]
    assert sensed.depth_cm == pytest.approx((np.mean(depth), min(depth), max(depth)), rel=2e-3)
    assert sensed.radius_m == pytest.approx((np.mean(radius), min(radius), max(radius)), rel=2e-3)
    assert sensed_soil([np.nan], 1.4, 0.0, air) is None


@pytest.mark.parametrize("radius_m", [5.0, 10.0, 40.0])
def test_rings_send_equal_shares_and_86_percent_lie_within_the_radius(radius_m):
    shape = Footprint.shielded(radius_m)
    assert shape.share(radius_m) == pytest.approx(0.86)
    rings = shape.rings(50)
    assert (np.diff(rings) > 0).all()
    assert [shape.share(ring) for ring in rings[::10]] == pytest.approx((np.arange(0, 50, 10) + 0.5) / 50)
