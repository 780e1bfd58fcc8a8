# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Agreement of TF and fixes: what is recovered, what it says, and what it does not mind."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration.guard.frames import (
    Agreement,
    FrameCheck,
    datum_text,
    direction,
    parse_datum,
)
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.geodesy import LocalFrame, PlaneMove

FIELD = LocalFrame(52.4660, 12.9580)
STANDING = [(10.0, 20.0)] * 20
metres = st.floats(-3000, 3000)
turns = st.floats(-math.pi, math.pi)


def drive(length_m=60.0, step_m=1.0):
    """A loop: places every second."""
    along = np.arange(0.0, length_m, step_m)
    return [(float(x), 5.0 * math.sin(x / 10)) for x in along]


def checked(places, move, known=None, noise_m=0.0, limit_m=2.0, seed=0):
    """A check after a robot was at these places with a navigation whose frame is moved."""
    rng = np.random.default_rng(seed)
    check = FrameCheck(FIELD, limit_m, known)
    for second, place in enumerate(places):
        x, y = np.array(place) + rng.normal(0, noise_m, 2)
        check.add(float(second), (x, y), move.place(place))
    return check, check.verdict(len(places) - 1.0)


def test_a_shift_of_30_m_is_named_with_direction_and_remedy():
    _, verdict = checked(STANDING, PlaneMove(0.0, (0.0, 30.0)))
    assert verdict.agreement is Agreement.DISAGREE
    assert (verdict.east_m, verdict.north_m, verdict.distance_m) == pytest.approx((0.0, 30.0, 30.0))
    assert "TF places the robot 30.0 m north of its fix (0.0 m east, 30.0 m north; limit 2.0 m)" in verdict.message
    assert "give the navigation the field's datum 52.4660000,12.9580000" in verdict.message
    explained = verdict.message.split("navigation_datum: ")[1].split(", which")[0]
    assert checked(STANDING, PlaneMove(0.0, (0.0, 30.0)), parse_datum(explained, FIELD))[1].distance_m < 0.05


@pytest.mark.slow
@settings(max_examples=20)
@given(metres, metres, turns, st.integers(0, 2**32 - 1))
def test_any_other_datum_is_recovered_from_a_drive_with_noise(east, north, yaw, seed):
    move = PlaneMove(yaw, (east, north))
    check, _ = checked(drive(), move, noise_m=0.1, seed=seed)
    found = check.fitted()
    assert found is not None
    for place in ((0.0, 0.0), (60.0, 0.0)):
        assert math.dist(found.place(place), move.place(place)) < 0.6
    again = parse_datum(datum_text(FIELD, found), FIELD)
    assert checked(drive(), move, again, noise_m=0.1, seed=seed)[1].agreement is Agreement.AGREE


@given(st.floats(-1000, 1000), st.floats(-1000, 1000), turns)
def test_a_known_move_agrees(east, north, yaw):
    move = PlaneMove(yaw, (east, north))
    assert checked(drive(), move, move)[1].agreement is Agreement.AGREE


def test_a_turned_map_disagrees_once_the_robot_is_away_from_its_origin():
    _, verdict = checked([(100.0, 0.0)] * 10, PlaneMove(math.radians(10.0)))
    assert verdict.agreement is Agreement.DISAGREE
    check, verdict = checked(drive(), PlaneMove(math.radians(10.0)))
    assert verdict.message.endswith("52.4660000,12.9580000,-10.0000, which explains the shift")
    assert check.fitted().yaw_rad == pytest.approx(math.radians(10.0))


def test_bad_fixes_among_good_ones_have_no_effect():
    places = [*STANDING[:12], (5000.0, 5000.0), (math.nan, 0.0), (-80.0, 3.0)]
    check = FrameCheck(FIELD, 2.0)
    for second, place in enumerate(places):
        check.add(float(second), place, STANDING[0])
    assert check.verdict(15.0).agreement is Agreement.AGREE
    check, _ = checked(drive(), PlaneMove(0.5, (7.0, 8.0)))
    check.add(61.0, (2000.0, -300.0), PlaneMove(0.5, (7.0, 8.0)).place((62.0, 0.0)))
    assert math.dist(check.fitted().place((0.0, 0.0)), (7.0, 8.0)) < 0.01


def test_a_robot_that_moves_may_be_ahead_of_its_fix():
    check = FrameCheck(FIELD, 1.0)
    for second in range(20):  # 2 m/s, the fix a second late
        check.add(float(second), (2.0 * second - 2.0, 0.0), (2.0 * second, 0.0))
    assert check.verdict(19.0).agreement is Agreement.AGREE
    assert check.verdict(19.0).limit_m == pytest.approx(3.0)
    for second in range(20, 40):  # stands still, and the shift stays
        check.add(float(second), (36.0, 0.0), (38.0, 0.0))
    assert check.verdict(39.0).agreement is Agreement.DISAGREE


def test_a_distance_that_varies_is_no_datum():
    rng = np.random.default_rng(1)
    check = FrameCheck(FIELD, 2.0)
    for second in range(20):
        x, y = rng.uniform(-50, 150, 2)
        check.add(float(second), (0.0, 0.0), (float(x), float(y)))
    message = check.verdict(19.0).message
    assert "check the localisation" in message
    assert "navigation_datum" not in message


def test_little_is_known_from_few_or_old_pairs():
    check, verdict = checked(STANDING[:4], PlaneMove())
    assert verdict.agreement is Agreement.UNKNOWN
    assert "4 pairs of TF and fix of 5" in verdict.message
    check, verdict = checked(STANDING, PlaneMove())
    assert verdict.agreement is Agreement.AGREE
    assert check.verdict(100.0).agreement is Agreement.UNKNOWN
    assert check.fitted() is None  # it has not moved


def test_a_clock_that_steps_back_starts_anew():
    check, _ = checked(STANDING, PlaneMove(0.0, (30.0, 0.0)))
    for second in range(-100, -90):
        check.add(float(second), (0.0, 0.0), (0.0, 0.0))
    assert check.verdict(-91.0).agreement is Agreement.AGREE


@pytest.mark.parametrize(
    ("offset", "word"),
    [((1, 0), "east"), ((1, 1), "north-east"), ((-3, 0), "west"), ((0, -2), "south"), ((2, -2), "south-east")],
)
def test_directions(offset, word):
    assert direction(*offset) == word


@pytest.mark.parametrize("text", ["", "52.0", "north", "52,13,0,0", "95,13", "52,13,nan", "-52.466,-167.042"])
def test_what_is_no_datum_is_refused(text):
    with pytest.raises(InputError, match="LAT,LON"):
        parse_datum(text, FIELD)


def test_a_datum_is_read_back():
    move = parse_datum("52.467,12.959,30", FIELD)
    assert datum_text(FIELD, move) == "52.4670000,12.9590000,30.0000"
    assert parse_datum("52.4660,12.9580", FIELD).is_identity
