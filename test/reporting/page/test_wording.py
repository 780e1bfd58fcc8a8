# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Notes to the reader of a map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.mapping.drift import Change, Drift, Jump
from soilmoist_ros.pipeline.run import CorrectionRow, NoteCode
from soilmoist_ros.reporting.page.statistics import mean_moisture, moisture_text
from soilmoist_ros.reporting.page.wording import facts, notes


def codes(run):
    return [note.code for note in notes(run)]


def test_a_guessed_calibration_is_noted_by_its_mark_not_by_words(make_run):
    run = make_run(notes=())
    said = replace(run, calibration=replace(run.calibration, source="not illustrative: 6 cores"))
    assert NoteCode.ILLUSTRATIVE_CALIBRATION not in codes(said)
    guessed = replace(run, calibration=replace(run.calibration, illustrative=True))
    assert codes(guessed)[0] is NoteCode.ILLUSTRATIVE_CALIBRATION


def test_n0_per_hour_factors_far_from_1_and_an_n0_of_unknown_origin_are_noted(make_run, the_map):
    per_hour = replace(the_map, curve=replace(the_map.curve, n0_cps=3600 * the_map.curve.n0_cps))
    run = make_run(soil_map=per_hour, simulated=False, notes=())
    (doubt,) = [note.message for note in notes(run) if note.code is NoteCode.OTHER_TIME_OF_N0]
    assert f"if it is per hour: {the_map.curve.n0_cps:.4g} counts/s" in doubt
    other_station = CorrectionRow("incoming neutrons", "C0 / C", {"C0": 1500}, 10.0, 9.9, 10.1)
    assert NoteCode.UNUSUAL_FACTOR in codes(replace(run, corrections=[other_station]))
    unknown = replace(run, calibration=replace(run.calibration, source="", n0_sd_cps=None))
    assert NoteCode.UNKNOWN_CALIBRATION in codes(unknown)
    assert not {NoteCode.UNUSUAL_FACTOR, NoteCode.UNKNOWN_CALIBRATION} & {*codes(run)}
    usual = make_run(soil_map=the_map, simulated=False)
    assert NoteCode.OTHER_TIME_OF_N0 not in codes(usual)


def test_moisture_that_no_soil_has_is_noted(make_run, the_map, steep, uncalibrated):
    assert NoteCode.RATE_BELOW_CURVE in codes(make_run(soil_map=steep))
    assert NoteCode.ABOVE_PORE_VOLUME in codes(make_run(soil_map=steep))
    unsure = replace(the_map, variance=100 * the_map.variance)
    assert NoteCode.BEYOND_LIMITS in codes(make_run(soil_map=unsure))
    sure = replace(the_map, variance=the_map.variance / 100, curve=replace(the_map.curve, n0_sd_cps=0.0))
    assert NoteCode.BEYOND_LIMITS not in codes(make_run(soil_map=sure))
    assert codes(make_run(soil_map=uncalibrated, notes=(), calibration=None)) == []


def test_a_change_during_the_survey_is_noted(make_run, uncalibrated):
    def said(change):
        return notes(make_run(soil_map=replace(uncalibrated, change=change), notes=(), calibration=None))

    rain = Jump(1.78e9, -0.4, 0.08, -0.1)
    assert said(Change(jump=replace(rain, sd_cps=0.2))) == []
    (note,) = said(Change(jump=rain, drift=Drift(0.99, True, (0.0, 1.0), (0.1, 0.0))))
    assert note.code is NoteCode.RAIN_LIKELY
    assert "at about 20:26 UTC: the rate fell by (10 ± 2) %" in note.message
    (note,) = said(
        Change(Drift(0.99, False, (0.0, 1.0), (-0.09, 0.0), ((0.02, 0.0),)), replace(rain, change_cps=0.1))
    )
    assert note.code is NoteCode.RATE_CHANGED
    assert "the rate rose by (10 ± 2) %" in note.message
    (note,) = said(Change(Drift(0.8, False, (0.0, 1.0), (-0.01, 0.0), ((0.03, 0.0),)), rain))
    assert "the rate fell by (10 ± 2) % within minutes" in note.message, "rain has the size of the jump"
    (note,) = said(Change(Drift(0.8, False, (0.0, 1.0), (-0.01, 0.0), ((0.03, 0.0),))))
    assert note.message.startswith(
        "The field may have changed in between: no change of the rate from begin to end"
    )
    assert "can be seen: (+1 ± 3) %" in note.message


def test_records_outside_the_field_are_noted_below_one_half(make_run):
    run = make_run(notes=())
    inside, placed = run.inside
    assert inside == placed == len(run.track) - 1, "one record has no place"
    assert NoteCode.OUTSIDE_FIELD not in codes(run)
    away = [replace(record, x_m=record.x_m + 1000.0) for record in run.track]
    half = [*away[: placed // 2], *run.track[placed // 2 :]]
    assert NoteCode.OUTSIDE_FIELD not in codes(replace(run, track=half))
    most = replace(run, track=[*away[: placed // 2 + 1], *run.track[placed // 2 + 1 :]])
    assert NoteCode.OUTSIDE_FIELD in codes(most)
    (note,) = [note for note in notes(most) if note.code is NoteCode.OUTSIDE_FIELD]
    assert note.message.startswith(f"Only {most.inside[0]} of {placed} records lie inside the field")


@pytest.mark.parametrize(
    ("stamp_s", "said"),
    [(1.9e9, "in the future"), (3.1e8, "before 2000"), (1.7e9, None), (9.0e11, "in the future")],
)
def test_impossible_dates_are_noted(make_run, stamp_s, said):
    run = make_run(notes=())
    dated = replace(run, track=[replace(record, stamp_s=stamp_s) for record in run.track])
    found = [note.message for note in notes(dated) if note.code is NoteCode.IMPOSSIBLE_DATE]
    assert [said in message for message in found] == ([True] if said else [])
    assert NoteCode.IMPOSSIBLE_DATE not in codes(replace(dated, simulated=True)), (
        "a simulated clock may start at 0"
    )


def test_the_mean_has_the_interval_of_the_calibration_and_no_number_where_it_is_impossible(
    make_run, the_map, steep
):
    run = make_run()
    mean = mean_moisture(the_map)
    value, unit, meaning = facts(run)[0]
    assert value == f"{100 * mean.value:.1f} ({100 * mean.p05:.1f} to {100 * mean.p95:.1f})"
    assert (unit, meaning) == ("% vol.", "mean soil water content (90 % interval)")
    dry, full = the_map.limits
    assert moisture_text(0.2, 0.1, 0.3, the_map.limits) == ("20.0", "10.0 to 30.0", "")
    assert moisture_text(0.4, 0.3, full, the_map.limits)[2] == "cut at the limit of the pores"
    for limit, name in ((full, "pores"), (dry, "dry soil")):
        _, interval, remark = moisture_text(limit, limit, limit, the_map.limits)
        assert (interval, f"at the limit of the {name}: hardly possible" in remark) == ("", True)
    away = replace(the_map.samples, xy=the_map.samples.xy + np.where(np.arange(12) < 4, 1e4, 0.0)[:, None])
    found = facts(make_run(soil_map=replace(the_map, samples=away)))
    assert any(fact[0::2] == ("8", "places measured in the field, 4 outside") for fact in found)
    exact = replace(the_map, curve=replace(the_map.curve, n0_sd_cps=0.0))
    assert "without that of the calibration" in facts(make_run(soil_map=exact))[0].meaning
    found = facts(make_run(soil_map=steep))
    assert found[0].value == "impossible"
    assert found[0].meaning.endswith("% of the area: N0 does not fit the rate")
    assert all(fact.unit != "% vol." for fact in found)
