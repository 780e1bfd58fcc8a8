# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A robot in two frames: the datum of the navigation, headings, the tree of transforms, and the comparison."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration import FrameSettings, RobotFrames, Transform, yaw_rotation
from soilmoist_ros.exploration.guard.robot_frames import FrameCheck, TransformTree, datum_text, parse_datum
from soilmoist_ros.foundation import InputError, Level, LocalFrame, PlaneMove, move_between
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.sensing import Fix, FixStatus, Position

DATUM = LocalFrame(52.0, 13.0)
FIELD = Field("test", DATUM, np.array([(0.0, 0.0), (60.0, 0.0), (60.0, 40.0), (0.0, 40.0)]))
OTHER = LocalFrame(52.002, 13.001)


def frames(datum="field", **settings):
    return RobotFrames(FIELD, FrameSettings(datum=datum, **settings))


def fix(place, status=FixStatus.RTK, stamp_s=math.nan):
    latitude, longitude = DATUM.to_geographic([place])[0].tolist()
    return Fix(stamp_s, Position(latitude, longitude, 30.0, 0.02), status)


def drive(robot, move=None, steps=30, start_s=0.0, turn=0.0, antenna_m=(0.0, 0.0), tf=True):
    """Drive 1 m/s to the east, past TF of a navigation with this move; the last pose and time."""
    pose, now_s = None, start_s
    for step in range(steps):
        now_s = start_s + step
        base = (5.0 + step, 10.0)
        if tf:
            x, y = (move or PlaneMove()).place(base)
            yaw = (move or PlaneMove()).heading(0.0) + turn
            links = [
                Transform("map", "odom", (x - 3.0, y, 0.0), stamp_s=now_s),
                Transform("odom", "base_link", (3.0, 0.0, 0.1), yaw_rotation(yaw), stamp_s=now_s),
            ]
            robot.take_transforms(links, now_s)
        pose = robot.take_fix(fix((base[0] + antenna_m[0], base[1] + antenna_m[1])), now_s)
    return pose, now_s


def test_without_tf_nothing_is_checked_and_nothing_refused():
    robot = frames()
    pose, now_s = drive(robot, tf=False)
    assert pose.place_m == pytest.approx((34.0, 10.0), abs=1e-3)
    assert pose.yaw_rad == pytest.approx(0.0, abs=1e-3)  # by the course over ground
    assert (robot.health(now_s).level, robot.health(now_s).message) == (Level.OK, "not checked: no TF")
    assert robot.fault == robot.waiting_for == ""


def test_a_wrong_frame_stays_a_fault_until_it_is_seen_to_be_right():
    robot = frames()
    _, now_s = drive(robot)
    _, now_s = drive(robot, PlaneMove(0.0, (12.0, 0.0)), start_s=now_s + 1.0)
    assert "12.0 m east" in robot.fault
    _, now_s = drive(robot, tf=False, steps=60, start_s=now_s + 1.0)
    assert "12.0 m east" in (found := robot.fault), "the planner has lost TF; the navigation still drives by it"
    health = robot.health(now_s)
    assert (health.level, health.message) == (Level.ERROR, f"{found}; since then not checked: TF is 60 s old")
    drive(robot, start_s=now_s + 1.0)
    assert robot.fault == ""


def test_the_same_frame_agrees():
    robot = frames()
    drive(robot, steps=3)
    assert robot.waiting_for == "agreement of TF and fixes (not checked yet: 3 pairs of TF and fix of 5)"
    _, now_s = drive(robot, start_s=3.0)
    assert robot.fault == robot.waiting_for == ""
    assert robot.health(now_s).message.startswith("TF and fix agree within 0.0 m")
    assert robot.health(now_s).level is Level.OK


@pytest.mark.parametrize("yaw_deg", [0.0, 77.0])
def test_a_given_datum_agrees_and_gives_headings_in_the_field(yaw_deg):
    move = move_between(DATUM, OTHER, math.radians(yaw_deg))
    robot = frames(f"52.002,13.001,{yaw_deg}", navigation_frame="map", frame="field")
    pose, now_s = drive(robot, move)
    assert robot.fault == ""
    assert pose.yaw_rad == pytest.approx(0.0, abs=1e-3)
    assert robot.health(now_s).values["datum of the navigation"].startswith("52.0020000,13.0010000")
    assert robot.health(now_s).level is Level.OK


def test_the_datum_of_the_navigations_map_and_another_one_of_a_later_map():
    robot = frames("map", frame="field")
    assert robot.move is None
    assert robot.waiting_for == "a map of the navigation with a datum"
    robot.take_map_datum(None)
    assert "origin, or datum_latitude and datum_longitude" in robot.waiting_for
    assert robot.health(0.0).level is Level.ERROR
    for datum, fault in ((OTHER, ""), (DATUM, "start the planner again"), (OTHER, "")):
        robot.take_map_datum(datum)
        assert robot.fault.endswith(fault)
        assert bool(robot.fault) == bool(fault)
    drive(robot, move_between(DATUM, OTHER))
    assert robot.fault == robot.waiting_for == ""


@pytest.mark.parametrize(
    ("settings", "frame", "fault"),
    [
        ({}, "map", ""),
        ({}, "/map", ""),
        ({}, "", ""),
        ({}, "odom", "in the frame 'odom', but navigation_frame is 'map': set navigation_frame"),
        ({"navigation_frame": "nav"}, "nav", ""),
        ({"navigation_frame": "nav"}, "map", ""),
        (
            {"navigation_frame": "nav", "datum": "52.002,13.001"},
            "map",
            "'map', but the field's, 'map', and navigation_frame is 'nav'",
        ),
    ],
)
def test_a_map_in_a_frame_of_nobody_is_refused_by_its_name(settings, frame, fault):
    robot = frames(**settings)
    robot.take_map_datum(None, frame)
    assert fault in robot.fault
    assert bool(robot.fault) == bool(fault)


def test_the_datum_from_a_drive_by_hand():
    move = PlaneMove(1.0, (200.0, -50.0))
    robot = frames("robot", frame="field")
    assert "20 m driven by hand" in robot.waiting_for
    drive(robot, move, steps=15)
    assert robot.move is None
    drive(robot, move, steps=30, start_s=15.0)
    assert robot.move.place((30.0, 20.0)) == pytest.approx(move.place((30.0, 20.0)), abs=0.1)
    assert robot.fault == ""


def test_tf_that_ends_or_is_not_connected_is_named():
    robot = frames()
    _, now_s = drive(robot)
    assert robot.health(now_s + 12.0).message == "not checked: TF is 12 s old"
    assert robot.health(now_s + 12.0).level is Level.WARN
    apart = frames(base_frame="chassis")
    drive(apart)
    assert apart.health(30.0).message == "not checked: TF has no frame chassis"
    assert apart.health(30.0).level is Level.WARN


def test_a_robot_is_where_its_base_is():
    antenna_m = (0.8, 0.3)
    robot = frames(antenna_m=antenna_m)
    pose, _ = drive(robot, antenna_m=antenna_m)
    assert pose.place_m == pytest.approx((34.0, 10.0), abs=1e-3)
    assert robot.fault == ""
    by_course = frames(antenna_m=antenna_m)
    pose, _ = drive(by_course, antenna_m=antenna_m, tf=False)
    assert pose.place_m == pytest.approx((34.0, 10.0), abs=1e-2)


# Poses along a tree of transforms -------------------------------------------------------------------------------

NAN = math.nan
metres = st.floats(-1000, 1000)
turns = st.floats(-math.pi, math.pi)


def link(parent, child, x=0.0, y=0.0, yaw=0.0, **more):
    return Transform(parent, child, (x, y, 0.3), yaw_rotation(yaw), **more)


def tree(*links, now_s=100.0):
    grown = TransformTree()
    grown.add(links, now_s)
    return grown


def matrix(x, y, yaw):
    return np.array([(math.cos(yaw), -math.sin(yaw), x), (math.sin(yaw), math.cos(yaw), y), (0, 0, 1)])


@given(*(st.tuples(metres, metres, turns) for _ in range(3)))
def test_poses_follow_the_links_of_both_branches(first, second, third):
    """earth -> map -> odom -> base_link, and the same seen from map."""
    grown = tree(link("earth", "map", *first), link("map", "odom", *second), link("odom", "base_link", *third))
    wanted = matrix(*second) @ matrix(*third)
    pose = grown.pose("base_link", "map", 101.0)
    assert (pose.x_m, pose.y_m) == pytest.approx(tuple(wanted[:2, 2]), abs=1e-6)
    assert math.cos(pose.yaw_rad - second[2] - third[2]) == pytest.approx(1.0)
    back = grown.pose("map", "base_link", 101.0)
    assert (back.x_m, back.y_m) == pytest.approx(tuple(np.linalg.inv(wanted)[:2, 2]), abs=1e-6)


def test_the_age_is_that_of_the_oldest_link_that_is_not_static():
    grown = tree(link("odom", "base_link", stamp_s=102.0))  # stamped ahead of its arrival
    grown.add([link("map", "odom", stamp_s=101.0)], 103.0)
    grown.add([link("base_link", "gnss", stamp_s=40.0, static=True)], 50.0)
    assert grown.pose("gnss", "map", 104.0).age_s == pytest.approx(4.0)
    grown.add([link("odom", "base_link", stamp_s=103.5)], 103.6)
    assert grown.pose("gnss", "map", 104.0).age_s == pytest.approx(3.0)
    assert tree(link("map", "base_link", static=True)).pose("base_link", "map", 1e9).age_s == 0.0


def test_the_newest_counts_and_an_older_one_is_ignored_unless_the_clock_was_set_back():
    grown = tree(link("map", "base_link", 1.0, stamp_s=50.0))
    grown.add([link("map", "base_link", 2.0, stamp_s=49.0)], 101.0)
    assert grown.pose("base_link", "map", 101.0).x_m == 1.0
    grown.add([link("map", "base_link", 3.0, stamp_s=10.0)], 102.0)
    assert grown.pose("base_link", "map", 102.0).x_m == 3.0


@pytest.mark.parametrize(
    "bad",
    [
        Transform("map", "base_link", (NAN, 0.0, 0.0)),
        Transform("map", "base_link", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)),
        Transform("map", "base_link", (0.0, 0.0, 0.0), (1e-200, 0.0, 0.0, 0.0)),
        Transform("map", "base_link", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1e200)),
        Transform("base_link", "base_link", (0.0, 0.0, 0.0)),
    ],
)
def test_an_impossible_transform_is_ignored(bad):
    assert len(tree(bad)) == 0


def test_what_is_not_connected_is_named():
    grown = tree(link("odom", "base_link"), link("world", "map"))
    assert grown.gap("base_link", "map") == "TF does not connect base_link with map"
    assert grown.gap("base_link", "utm") == "TF has no frame utm"


# Agreement of TF and fixes: what is recovered, what it says, and what it does not mind --------------------------

PLANE = LocalFrame(52.4660, 12.9580)
STANDING = [(10.0, 20.0)] * 20


def loop(length_m=60.0, step_m=1.0):
    along = np.arange(0.0, length_m, step_m)
    return [(float(x), 5.0 * math.sin(x / 10)) for x in along]


def checked(places, move, known=None, noise_m=0.0, seed=0):
    """A check after a robot was at these places with a navigation whose frame is moved."""
    rng = np.random.default_rng(seed)
    check = FrameCheck(PLANE, known)
    for second, place in enumerate(places):
        x, y = np.array(place) + rng.normal(0, noise_m, 2)
        check.add(float(second), (x, y), move.place(place))
    return check, check.verdict(len(places) - 1.0)


def test_a_shift_of_30_m_is_named_with_direction_and_remedy():
    _, verdict = checked(STANDING, PlaneMove(0.0, (0.0, 30.0)))
    assert verdict.agrees is False
    assert "TF places the robot 30.0 m from its fix (0.0 m east, 30.0 m north; limit 2.0 m)" in verdict.message
    assert "give the navigation the field's datum 52.4660000,12.9580000" in verdict.message
    explained = verdict.message.split("navigation_datum: ")[1].split(", which")[0]
    again = checked(STANDING, PlaneMove(0.0, (0.0, 30.0)), parse_datum(explained, PLANE))[1]
    assert again.message.startswith("TF and fix agree within 0.0 m")


@pytest.mark.slow
@settings(max_examples=20)
@given(metres, metres, turns, st.integers(0, 2**32 - 1))
def test_any_other_datum_is_recovered_from_a_drive_with_noise(east, north, yaw, seed):
    move = PlaneMove(yaw, (east, north))
    check, _ = checked(loop(), move, noise_m=0.1, seed=seed)
    found = check.fitted(reach_m=100.0)
    assert found is not None
    assert checked(loop(25.0), move, noise_m=0.5, seed=seed)[0].fitted(reach_m=500.0) is None, "not exact enough"
    for place in ((0.0, 0.0), (60.0, 0.0)):
        assert math.dist(found.place(place), move.place(place)) < 0.6
    again = parse_datum(datum_text(PLANE, found), PLANE)
    assert checked(loop(), move, again, noise_m=0.1, seed=seed)[1].agrees is True


def test_bad_fixes_among_good_ones_have_no_effect():
    places = [*STANDING[:12], (5000.0, 5000.0), (math.nan, 0.0), (-80.0, 3.0)]
    check = FrameCheck(PLANE)
    for second, place in enumerate(places):
        check.add(float(second), place, STANDING[0])
    assert check.verdict(15.0).agrees is True
    check, _ = checked(loop(), PlaneMove(0.5, (7.0, 8.0)))
    check.add(61.0, (2000.0, -300.0), PlaneMove(0.5, (7.0, 8.0)).place((62.0, 0.0)))
    assert math.dist(check.fitted().place((0.0, 0.0)), (7.0, 8.0)) < 0.01


def test_a_robot_that_moves_may_be_ahead_of_its_fix():
    check = FrameCheck(PLANE)
    for second in range(20):  # 2 m/s, the fix a second late
        check.add(float(second), (2.0 * second - 2.0, 0.0), (2.0 * second, 0.0))
    assert check.verdict(19.0).agrees is True
    assert "(limit 4.0 m)" in check.verdict(19.0).message
    for second in range(20, 40):  # stands still, and the shift stays
        check.add(float(second), (36.0, 0.0), (38.5, 0.0))
    assert check.verdict(39.0).agrees is False


def test_a_distance_that_varies_is_no_datum():
    rng = np.random.default_rng(1)
    check = FrameCheck(PLANE)
    for second in range(20):
        x, y = rng.uniform(-50, 150, 2)
        check.add(float(second), (0.0, 0.0), (float(x), float(y)))
    message = check.verdict(19.0).message
    assert "check the localisation" in message
    assert "navigation_datum" not in message


@pytest.mark.parametrize("text", ["", "52.0", "north", "52,13,0,0", "95,13", "52,13,nan", "-52.466,-167.042"])
def test_what_is_no_datum_is_refused(text):
    with pytest.raises(InputError, match="LAT,LON"):
        parse_datum(text, PLANE)
