# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Places that the robot can have reached, and those that it cannot."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.sensing.position.place_doubt import Doubt, DoubtOutcome, Doubts, none_since, placed
from soilmoist_ros.sensing.position.place_judge import (
    COMPARED,
    STAYS_S,
    TOLERANCE,
    Expected,
    PlaceAges,
    PlaceFix,
    PlaceJudge,
    PlaceLimits,
    Verdict,
)
from soilmoist_ros.sensing.records import CountRecord

LIMITS = PlaceLimits()


def confirmed(now_s=0.0):
    places = PlaceJudge(LIMITS)
    for number in range(LIMITS.first_fixes):
        verdict = places.take(PlaceFix(now_s - LIMITS.first_fixes + 1 + number, 0.0, 0.0))
    assert verdict is Verdict.PLAUSIBLE
    return places


def test_the_first_place_needs_agreement():
    places = PlaceJudge(LIMITS)
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


@pytest.mark.parametrize(
    ("fix", "verdict"),
    [
        (PlaceFix(1.0, math.nan, 0.0), Verdict.NO_PLACE),
        (PlaceFix(1.0, 0.0, math.inf), Verdict.NO_PLACE),
        (PlaceFix(1.0, 0.0, 0.0, sd_m=10.1), Verdict.UNCERTAIN),
        (PlaceFix(1.0, 0.0, 0.0, sd_m=9.9), Verdict.PLAUSIBLE),
        (PlaceFix(1.0, 0.0, 0.0, sd_m=math.nan), Verdict.PLAUSIBLE),
        (PlaceFix(0.1, LIMITS.max_jump_m, 0.0, sd_m=9.9), Verdict.PLAUSIBLE),
        (PlaceFix(0.1, LIMITS.max_jump_m + 0.1, 0.0, sd_m=9.9), Verdict.JUMP),
        (PlaceFix(1.0, LIMITS.max_jump_m + LIMITS.max_acceleration_mps2 / 2 + 0.1, 0.0), Verdict.JUMP),
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
    places = PlaceJudge(LIMITS)
    burst = [places.take(PlaceFix(5.0, 7.0 * n, 0.0, stamp_s=10.0 * n, age_s=math.inf)) for n in range(20)]
    assert set(burst) == {Verdict.UNCONFIRMED}
    now = [places.take(PlaceFix(6.0 + n, 500.0, 0.0, stamp_s=900.0 + n)) for n in range(3)]
    assert now == [Verdict.UNCONFIRMED, Verdict.UNCONFIRMED, Verdict.PLAUSIBLE]
    assert places.fix.xy == (500.0, 0.0)


def test_a_wrong_stamp_does_not_excuse_a_jump():
    places = confirmed()
    places.take(PlaceFix(1.0, 0.0, 0.0, stamp_s=1.0))
    assert places.take(PlaceFix(2.0, 1000.0, 0.0, stamp_s=1e9)) is Verdict.JUMP


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
    places, now_s, since = PlaceJudge(LIMITS), 0.0, 0
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


# What is trusted ---------------------------------------------------------------------------------------------

RECEIVERS = {  # standard deviation of each coordinate, time of its wander, white noise, stated standard deviation
    "rtk": (0.01, 120.0, 0.01, 0.02),
    "float": (0.3, 200.0, 0.05, 0.4),
    "standalone 1": (1.0, 120.0, 0.2, 1.0),
    "standalone 2.5": (2.5, 90.0, 0.2, 2.5),
    "unknown": (0.05, 120.0, 0.01, math.nan),
    "unknown 2.5": (2.5, 120.0, 0.2, math.nan),
    "zero": (0.01, 120.0, 0.01, 0.0),
    "held": (1.5, 120.0, 0.1, 2.0),
}


class Survey:
    """A robot that drives for a minute and stands for some, a receiver, a fault, and records every 10 s."""

    def __init__(self, kind, seed=1):
        self.rng, self.judge = np.random.default_rng(seed), PlaceJudge(LIMITS)
        self.kind, (self.sd_m, self.wander_s, self.white_m, self.stated_m) = kind, RECEIVERS[kind]
        self.error, self.held = self.rng.normal(0.0, self.sd_m, 2), None
        self.time_s, self.place, self.doubts = 1e6, np.zeros(2), Doubts()
        self.records, self.begun, self.ended = [], 0, []

    def second(self, expected, off=(0.0, 0.0)):
        self.time_s += 1.0
        keeps = math.exp(-1.0 / self.wander_s)
        self.error = keeps * self.error + math.sqrt(1 - keeps**2) * self.rng.normal(0.0, self.sd_m, 2)
        fix = self.place + self.error + self.rng.normal(0.0, self.white_m, 2)
        stands = expected is Expected.STANDING
        self.held = (fix if self.held is None else self.held) if stands and self.kind == "held" else None
        fix = (fix if self.held is None else self.held) + off
        self.judge.expect(expected, self.time_s)
        self.verdict = self.judge.take(PlaceFix(self.time_s, *fix.tolist(), self.stated_m, self.time_s))
        for doubt in self.judge.news():
            self.doubts.take(doubt)
            self.begun += doubt.outcome is DoubtOutcome.OPEN
            self.ended += [doubt.outcome] if doubt.outcome is not DoubtOutcome.OPEN else []
        if self.time_s % 10 == 5:
            record = CountRecord(self.time_s + 5.0, *fix.tolist(), 0.0, 5, 10.0, 10.0)
            self.records.append((record, self.place.copy()))

    def drive(self, seconds=60):
        heading = self.rng.uniform(0.0, 2 * math.pi)
        for _ in range(seconds):
            self.place = self.place + 0.6 * np.array([math.cos(heading), math.sin(heading)])
            self.second(Expected.DRIVING)
        return self

    def stand(self, seconds, off=lambda second: (0.0, 0.0)):
        for second in range(seconds):
            self.second(Expected.STANDING, off(second))
        return self

    @property
    def errors_m(self):
        trusted = [(self.doubts.placed(record), place) for record, place in self.records]
        return [math.dist((one.x_m, one.y_m), place) for one, place in trusted if not one.quarantine]


@pytest.mark.parametrize("kind", RECEIVERS)
def test_receivers_that_work_are_never_doubted(kind):
    survey = Survey(kind)
    for _ in range(10):
        survey.drive().stand(300)
    assert (survey.begun, survey.judge.counts[Verdict.JUMP]) == (0, 0)


@pytest.mark.parametrize("kind", ["rtk", "float", "unknown", "zero"])
@pytest.mark.parametrize("away_m", [4.0, 8.0, 14.0])
@pytest.mark.parametrize("lasts_s", [5, 50, 200])
def test_a_jump_of_a_standing_robot_that_ends_costs_no_record(kind, away_m, lasts_s):
    survey = Survey(kind).drive().stand(400, lambda s: (away_m, 0.0) if 100 <= s < 100 + lasts_s else (0.0, 0.0))
    assert set(survey.ended) == {DoubtOutcome.RETURNED}
    assert len(survey.errors_m) == len(survey.records)
    assert max(survey.errors_m) < 1.5


@pytest.mark.parametrize("kind", ["rtk", "float", "unknown", "zero"])
@pytest.mark.parametrize("away_m", [4.0, 8.0, 14.0])
def test_a_robot_that_was_carried_waits_for_people_and_its_records_do(kind, away_m):
    survey = Survey(kind).drive().stand(300, lambda s: (away_m, 0.0) if s >= 100 else (0.0, 0.0))
    assert (survey.ended, survey.verdict) == ([], Verdict.PLAUSIBLE)
    assert max(survey.errors_m) < 1.5
    assert 19 <= len(survey.records) - len(survey.errors_m) <= 22
    survey.judge.confirm()
    survey.place = survey.place + np.array([away_m, 0.0])
    survey.stand(60)
    assert survey.ended == [DoubtOutcome.CONFIRMED]
    assert len(survey.errors_m) == len(survey.records)


def test_people_confirm_the_place_of_now_and_not_a_jump_before_it():
    survey = Survey("rtk").drive().stand(120, lambda s: (14.0, 0.0) if 2 <= s < 40 else (0.0, 0.0))
    survey.judge.confirm()
    survey.stand(60)
    assert DoubtOutcome.CONFIRMED in survey.ended
    assert max(survey.errors_m) < 1.5
    assert 3 <= len(survey.records) - len(survey.errors_m) <= 5


@pytest.mark.parametrize(
    ("kind", "speed_mps"),
    [("rtk", 0.1), ("rtk", 0.3), ("rtk", 2.0), ("float", 0.3), ("zero", 0.3), ("unknown", 2.0)],
)
def test_a_drift_of_a_standing_robot_is_mapped_up_to_three_metres(kind, speed_mps):
    survey = Survey(kind).drive().stand(300, lambda s: (speed_mps * max(0, s - 100), 0.0))
    assert survey.begun == 1
    assert survey.judge.strayed_m > 0, "people must look"
    assert max(survey.errors_m) < LIMITS.max_jump_m
    assert len(survey.errors_m) < len(survey.records) - 15


def test_a_place_that_comes_back_after_it_was_believed_for_driving_is_the_first_one():
    survey = Survey("rtk").drive().stand(400, lambda s: (8.0, 0.0) if 100 <= s < 100 + 2 * STAYS_S else (0.0, 0.0))
    assert survey.ended == [DoubtOutcome.RETURNED]
    assert survey.judge.counts[Verdict.JUMP] == STAYS_S
    assert len(survey.errors_m) == len(survey.records)


def test_a_correction_that_the_stated_error_explains_is_believed():
    judge = PlaceJudge(LIMITS)
    judge.expect(Expected.STANDING, 0.0)
    for second in range(1, 61):
        judge.take(PlaceFix(second, 0.0, 0.0, 2.5))
    verdicts = [judge.take(PlaceFix(61.0 + second, 4.5, 0.0, 0.02)) for second in range(12)]
    assert verdicts == [Verdict.JUMP] * 9 + [Verdict.PLAUSIBLE] * 3
    assert judge.relocated_m == 0.0
    assert [doubt.outcome for doubt in judge.news()] == [DoubtOutcome.OPEN, DoubtOutcome.LOST]


def test_a_jump_of_a_driving_robot_is_lost_and_then_waits_for_people():
    survey = Survey("rtk").drive(30)
    for _ in range(30):
        survey.second(Expected.DRIVING, (40.0, 0.0))
    assert (survey.begun, survey.ended) == (1, [])
    assert max(survey.errors_m) < 1.0
    survey.judge.expect(Expected.STANDING, survey.time_s)
    survey.judge.expect(Expected.DRIVING, survey.time_s)
    assert [doubt.outcome for doubt in survey.judge.news()] == [DoubtOutcome.LOST], "somebody drives on from there"


def test_messages_that_were_held_up_while_it_drove_are_no_drift():
    judge = PlaceJudge(LIMITS)
    judge.expect(Expected.DRIVING, 0.0)
    for second in range(10):
        judge.take(PlaceFix(second, 0.6 * second, 0.0, 0.02, second))
    judge.expect(Expected.STANDING, 20.0)
    for second in range(10, 31):
        judge.take(PlaceFix(30.0, min(0.6 * second, 12.0), 0.0, 0.02, second, 30.0 - second))
    assert judge.news() == []


# What becomes of records -------------------------------------------------------------------------------------

RECORD = CountRecord(100.0, 9.0, 8.0, 0.0, 5, 10.0, 10.0)


@pytest.mark.parametrize(
    ("doubt", "reason", "result"),
    [
        (Doubt(103.0), "", (9.0, "")),  # it ended before
        (Doubt(101.0), "", (9.0, "place_doubt")),  # clocks differ
        (Doubt(50.0, 80.0, DoubtOutcome.LOST), "", (9.0, "")),
        (Doubt(50.0, 95.0, DoubtOutcome.LOST), "", (9.0, "place_doubt")),
        (Doubt(50.0, 95.0, DoubtOutcome.RETURNED, 1.0, 2.0), "place_jump", (1.0, "")),
        (Doubt(50.0, 95.0, DoubtOutcome.RETURNED, 1.0, 2.0), "", (1.0, "")),
        (Doubt(50.0, 95.0, DoubtOutcome.RETURNED, 1.0, 2.0), "noisy_tube", (9.0, "noisy_tube")),
        (Doubt(50.0, 95.0, DoubtOutcome.CONFIRMED), "place_doubt", (9.0, "")),
    ],
)
def test_records_of_a_doubt(doubt, reason, result):
    found = placed(replace(RECORD, quarantine=reason), [doubt])
    assert (found.x_m, found.quarantine) == result
    assert Doubt.from_text(doubt.to_text()).to_text() == doubt.to_text()


def test_a_planner_that_starts_ends_the_doubt_of_the_one_before():
    doubts = Doubts()
    for doubt in (Doubt(80.0), none_since(120.0)):
        assert doubts.take(doubt)
    later = [replace(RECORD, stamp_s=stamp_s) for stamp_s in (100.0, 125.0, 140.0)]
    assert [doubts.placed(record).quarantine for record in later] == ["place_doubt", "place_doubt", ""]


# Place ages ------------------------------------------------------------------------------------------------------


def used(stamp_less_now_s=0.0, seconds=40):
    """Ages after some seconds of places that come at once; the next one comes at ``seconds``."""
    ages = PlaceAges()
    for second in range(seconds):
        ages.age_s(float(second), second + stamp_less_now_s)
    return ages


@pytest.mark.parametrize("ahead_s", [0.0, -3600.0, 1e9])
def test_what_a_stalled_connection_held_back_has_its_age_whatever_the_clock_shows(ahead_s):
    ages = used(ahead_s, 10)
    came = [ages.age_s(100.0, stamp_s + ahead_s) for stamp_s in range(10, 101)]
    assert came == [100.0 - stamp_s for stamp_s in range(10, 101)]
    assert ages.age_s(101.0, 101.0 + ahead_s) == 0.0


def test_a_process_that_starts_in_a_stall_does_not_know_until_the_next_second():
    ages = PlaceAges()
    assert {ages.age_s(50.0, stamp_s) for stamp_s in range(51)} == {math.inf}
    assert ages.age_s(51.0, 51.0) == 0.0


def test_what_comes_late_all_the_time_is_a_clock_that_is_wrong():
    ages = used()
    late = [ages.age_s(40.0 + second, second - 20.0) for second in range(COMPARED + 1)]
    assert late[0] == 60.0
    assert late[-1] == 0.0


@given(st.lists(st.floats(0.0, 200.0), min_size=1, max_size=60), st.floats(-1e9, 1e9))
def test_no_age_is_negative_nor_more_than_the_delay(delays_s, ahead_s):
    ages = used(ahead_s, 2)
    for number, delay_s in enumerate(delays_s):
        now_s = 2.0 + number
        assert 0.0 <= ages.age_s(now_s, now_s - delay_s + ahead_s) <= delay_s + 1e-6
