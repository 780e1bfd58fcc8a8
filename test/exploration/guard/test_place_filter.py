# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Places that the robot can have reached, and those that it cannot."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.exploration.guard.place_filter import TOLERANCE, PlaceFilter, PlaceFix, PlaceLimits, Verdict

LIMITS = PlaceLimits()


def confirmed(limits=LIMITS, place=(0.0, 0.0), now_s=0.0):
    """A filter that knows a place."""
    places = PlaceFilter(limits)
    for number in range(limits.first_fixes):
        verdict = places.take(PlaceFix(now_s - limits.first_fixes + 1 + number, *place))
    assert verdict is Verdict.PLAUSIBLE
    return places


def test_the_first_place_needs_agreement():
    places = PlaceFilter(LIMITS)
    assert places.take(PlaceFix(0.0, 0.0, 0.0)) is Verdict.UNCONFIRMED
    assert places.take(PlaceFix(1.0, 500.0, 0.0)) is Verdict.UNCONFIRMED
    assert places.take(PlaceFix(2.0, 0.0, 0.0)) is Verdict.UNCONFIRMED
    assert places.take(PlaceFix(3.0, 0.5, 0.0)) is Verdict.UNCONFIRMED
    assert places.fix is None
    assert places.take(PlaceFix(4.0, 1.0, 0.0)) is Verdict.PLAUSIBLE
    assert places.fix.xy == (1.0, 0.0)


def test_a_fix_two_kilometres_away_is_not_the_robots_place():
    places = confirmed()
    for second in range(1, 30):
        assert places.take(PlaceFix(second, 2000.0 + 200.0 * second, 0.0)) is Verdict.JUMP
    assert places.fix.xy == (0.0, 0.0)
    assert places.rejected == 29
    assert places.rejected_since_s == 1.0
    assert places.take(PlaceFix(30.0, 5.0, 0.0)) is Verdict.PLAUSIBLE
    assert places.rejected == 0


def test_places_that_agree_for_long_replace_those_they_contradict():
    places = confirmed()
    verdicts = [places.take(PlaceFix(1.0 + second, 300.0 + 0.5 * second, 0.0)) for second in range(12)]
    needed = LIMITS.agree_fixes
    assert verdicts == [Verdict.JUMP] * (needed - 1) + [Verdict.PLAUSIBLE] * (12 - needed + 1)
    assert places.fix.xy == (305.5, 0.0)
    assert places.speed_mps == pytest.approx(0.5)


def test_many_fixes_in_a_moment_agree_too_early():
    places = confirmed()
    verdicts = [places.take(PlaceFix(1.0 + number / 20, 300.0, 0.0)) for number in range(50)]
    assert set(verdicts) == {Verdict.JUMP}


def test_places_of_two_sources_do_not_confirm_each_other():
    places = confirmed()
    for second in range(1, 60):
        assert places.take(PlaceFix(second, 300.0 if second % 2 else -300.0, 0.0)) is Verdict.JUMP


@pytest.mark.parametrize(
    ("fix", "verdict"),
    [
        (PlaceFix(1.0, math.nan, 0.0), Verdict.NO_PLACE),
        (PlaceFix(1.0, 0.0, math.inf), Verdict.NO_PLACE),
        (PlaceFix(1.0, 0.0, 0.0, sd_m=10.1), Verdict.UNCERTAIN),
        (PlaceFix(1.0, 0.0, 0.0, sd_m=9.9), Verdict.PLAUSIBLE),
        (PlaceFix(1.0, 0.0, 0.0, sd_m=math.nan), Verdict.PLAUSIBLE),
        (PlaceFix(1.0, LIMITS.max_jump_m + TOLERANCE * LIMITS.max_speed_mps - 0.1, 0.0), Verdict.PLAUSIBLE),
        (PlaceFix(1.0, LIMITS.max_jump_m + TOLERANCE * LIMITS.max_speed_mps + 0.1, 0.0), Verdict.JUMP),
    ],
)
def test_one_fix(fix, verdict):
    places = confirmed()
    assert places.take(fix) is verdict
    assert places.counts[verdict] >= 1


def test_a_message_that_is_repeated_is_no_new_fix():
    places = confirmed()
    assert places.take(PlaceFix(1.0, 0.0, 0.0, stamp_s=7.0)) is Verdict.PLAUSIBLE
    assert places.take(PlaceFix(2.0, 0.0, 0.0, stamp_s=7.0)) is Verdict.REPEATED
    assert places.take(PlaceFix(3.0, 0.0, 0.0, stamp_s=6.0)) is Verdict.PLAUSIBLE, "its clock was set back"
    assert places.fix.now_s == 3.0


def test_messages_that_were_held_up_are_no_jump():
    places = confirmed()
    places.take(PlaceFix(10.0, 0.0, 0.0, stamp_s=10.0))
    for second in range(11, 31):
        fix = PlaceFix(30.0, 1.0 * (second - 10), 0.0, stamp_s=float(second))
        assert places.take(fix) is Verdict.PLAUSIBLE
    assert places.speed_mps == pytest.approx(1.0)


def test_what_was_held_up_is_a_step_after_the_last_place_and_nothing_before_it():
    places = confirmed()
    places.take(PlaceFix(100.0, 0.0, 0.0))
    assert places.take(PlaceFix(120.0, 0.0, 7.0, age_s=21.0)) is Verdict.PAST
    assert places.take(PlaceFix(120.0, 0.0, 9.0, age_s=math.inf)) is Verdict.PAST
    assert places.fix.xy == (0.0, 0.0)
    assert places.take(PlaceFix(120.0, 2.0, 0.0, age_s=18.0)) is Verdict.PLAUSIBLE
    assert places.take(PlaceFix(120.0, 4.0, 0.0, age_s=1.0)) is Verdict.PLAUSIBLE


def test_the_first_place_is_not_one_of_unknown_age():
    """What a driver sends of the way so far when it starts again agrees with itself, too."""
    places = PlaceFilter(LIMITS)
    burst = [places.take(PlaceFix(5.0, 7.0 * n, 0.0, stamp_s=10.0 * n, age_s=math.inf)) for n in range(20)]
    assert set(burst) == {Verdict.UNCONFIRMED}
    now = [places.take(PlaceFix(6.0 + n, 500.0, 0.0, stamp_s=900.0 + n)) for n in range(3)]
    assert now == [Verdict.UNCONFIRMED, Verdict.UNCONFIRMED, Verdict.PLAUSIBLE]
    assert places.fix.xy == (500.0, 0.0)


def test_a_wrong_stamp_does_not_excuse_a_jump():
    places = confirmed()
    places.take(PlaceFix(1.0, 0.0, 0.0, stamp_s=1.0))
    assert places.take(PlaceFix(2.0, 1000.0, 0.0, stamp_s=1e9)) is Verdict.JUMP


def test_a_long_silence_does_not_excuse_a_jump():
    places = confirmed()
    assert places.take(PlaceFix(10_000.0, 1000.0, 0.0)) is Verdict.JUMP
    assert places.take(PlaceFix(10_001.0, 10.0, 0.0)) is Verdict.PLAUSIBLE


def test_slow_drift_is_seen_as_speed_and_fast_drift_as_a_jump():
    """Every step is short: 25 receivers' epochs a second."""
    for speed, verdicts in ((2.5, {Verdict.PLAUSIBLE}), (4.5, {Verdict.PLAUSIBLE}), (30.0, {Verdict.JUMP})):
        places = confirmed(now_s=0.0)
        seen = [places.take(PlaceFix(k / 25, speed * k / 25, 0.0)) for k in range(1, 500)]
        assert verdicts <= set(seen)
        if speed < 10:
            assert places.speed_mps == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize(
    "wrong", [{"max_speed_mps": -1.0}, {"first_fixes": 0}, {"agree_fixes": 0}, {"max_sd_m": math.nan}]
)
def test_limits_out_of_range(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        PlaceLimits(**wrong)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 3.0), st.floats(0.2, 5.0), st.floats(0.0, 1.0))
def test_a_robot_that_drives_as_it_can_is_never_lost(seed, speed, period_s, noise_m):
    rng = np.random.default_rng(seed)
    places = confirmed()
    place, heading = np.zeros(2), 0.0
    for number in range(1, 80):
        heading += rng.normal(0, 0.5)
        place += speed * period_s * np.array([math.cos(heading), math.sin(heading)])
        seen = place + np.clip(rng.normal(0.0, noise_m, 2), -2 * noise_m, 2 * noise_m)
        fix = PlaceFix(number * period_s, *seen.tolist(), sd_m=max(noise_m, 1e-3))
        assert places.take(fix) is Verdict.PLAUSIBLE


@given(
    st.lists(
        st.tuples(
            st.floats(0.01, 30.0),
            st.floats(-3000.0, 3000.0) | st.sampled_from([0.0, 1.0, math.nan, math.inf]),
            st.floats(-3000.0, 3000.0) | st.just(0.0),
            st.sampled_from([math.nan, 0.02, 3.0, 50.0]),
        ),
        max_size=80,
    )
)
def test_whatever_comes_plausible_places_are_connected_or_confirmed(fixes):
    """Between two plausible places in a row there is a way, or as many agreeing fixes as are asked for."""
    places, now_s, since = PlaceFilter(LIMITS), 0.0, 0
    for step_s, x_m, y_m, sd_m in fixes:
        now_s += step_s
        before = places.fix
        fix = PlaceFix(now_s, x_m, y_m, sd_m)
        verdict = places.take(fix)
        since += 1
        assert (places.fix is fix) == (verdict is Verdict.PLAUSIBLE)
        if verdict is Verdict.PLAUSIBLE:
            assert math.isfinite(x_m)
            assert not sd_m > LIMITS.max_sd_m
            if before is None:
                assert since >= LIMITS.first_fixes
            else:
                reach_m = LIMITS.max_jump_m + TOLERANCE * LIMITS.max_speed_mps * LIMITS.max_gap_s
                noise_m = 3 * math.hypot(*(s for s in (sd_m, before.sd_m) if math.isfinite(s)), 0.0)
                assert math.dist(before.xy, fix.xy) <= reach_m + noise_m or since >= LIMITS.agree_fixes
            since = 0
        else:
            assert places.fix is before
    assert sum(places.counts.values()) == len(fixes)
