# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Dose of a run: field_dose.py, and its words on the page."""

from __future__ import annotations

import dataclasses
import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nodes.browser import PHONE, chromium
from soilmoist_ros.mapping import EarlierSurvey, PoissonKriging, Samples
from soilmoist_ros.pipeline.run import CalibrationInfo, EarlierRun
from soilmoist_ros.reporting import irrigation, summary
from soilmoist_ros.reporting.certainty import CERTAIN
from soilmoist_ros.reporting.dose import DoseSettings, find_dose, saved_zones
from soilmoist_ros.reporting.page.field_dose import (
    BELOW_SD_SHARE,
    MINUTES,
    FieldDose,
    NoDose,
    _Decision,
    field_dose,
    soil_water_index,
)
from soilmoist_ros.reporting.page.report import render_report
from soilmoist_ros.sensing import Irrigation, SensedSoil

LIMITS = Irrigation(wilting_point=0.12, field_capacity=0.30, width_m=6, efficiency=0.8)
DEEP = SensedSoil((40.0, 35.0, 45.0), (10.0, 9.0, 11.0))


@given(days=st.lists(st.floats(0.5, 60), min_size=1, max_size=8), time=st.floats(2, 40), seed=st.integers(0, 99))
def test_recursive_filter_is_the_weighted_mean_of_wagner(days, time, seed):
    # Wagner et al. (1999): sum of m(t_i) exp(-(t - t_i)/T) by the sum of the weights
    at = np.cumsum([0.0, *days])
    vwc = np.random.default_rng(seed).uniform(0.05, 0.45, len(at))
    weights = np.exp(-(at[-1] - at) / time)
    index, gain = soil_water_index(at, vwc, time)
    assert index == pytest.approx(float((weights * vwc).sum() / weights.sum()))
    assert gain == pytest.approx(1 / weights.sum())


@pytest.mark.parametrize(
    ("changes", "missing"),
    [
        ({"calibration": CalibrationInfo(7.0, 1.4, illustrative=True)}, "a guess"),
        ({"irrigation": Irrigation()}, "texture, or wilting_point and field_capacity, are not in"),
        ({"irrigation": LIMITS.model_copy(update={"width_m": 90})}, "wider than the field"),
        (
            {"irrigation": LIMITS.model_copy(update={"target": 0.5, "field_capacity": 0.5})},
            "above the pore volume",
        ),
    ],
)
def test_a_run_without_a_dose_says_what_is_missing(make_run, changes, missing):
    run = make_run(**{"irrigation": LIMITS, **changes})
    found = field_dose(run)
    assert isinstance(found, NoDose)
    assert missing in found.missing
    assert summary(run)["dose"] == {"missing": found.missing, "remedy": found.remedy, "settings": None}
    assert not any("Irrigate" in step and "mm on" in step for step in irrigation(run).steps)


def test_rates_and_a_few_places_have_no_dose(make_run, uncalibrated, map_of):
    assert "not calibrated" in field_dose(make_run(soil_map=uncalibrated, calibration=None)).missing
    assert "fewer than 10 places" in field_dose(make_run(soil_map=map_of(n=5), irrigation=LIMITS)).missing


def test_a_calibration_without_a_deviation_has_no_dose_even_in_a_simulation(make_run, the_map):
    exact = dataclasses.replace(the_map, curve=dataclasses.replace(the_map.curve, n0_sd_cps=0.0))
    found = field_dose(make_run(irrigation=LIMITS, soil_map=exact))
    assert found.missing == "the calibration states no ±"
    assert "n0_sd_cps" in found.remedy
    assert field_dose(make_run(irrigation=LIMITS, soil_map=exact, simulated=True)) == found


def test_the_general_calibration_has_a_dose_where_it_is_sure(make_run, the_map):
    general = CalibrationInfo(7.0, 1.4, method="general")
    assert isinstance(field_dose(make_run(irrigation=LIMITS, calibration=general, sensed=DEEP)), FieldDose)
    wide = dataclasses.replace(the_map, curve=dataclasses.replace(the_map.curve, n0_sd_cps=1.0))
    found = field_dose(make_run(irrigation=LIMITS, calibration=general, soil_map=wide, sensed=DEEP))
    assert "whether to irrigate is certain on only" in found.missing
    assert "cores" in found.remedy
    for known in (dataclasses.replace(general, method="combined"), CalibrationInfo(7.0, 1.0)):  # one gate for all
        own = make_run(irrigation=LIMITS, calibration=known, soil_map=wide, sensed=DEEP)
        assert field_dose(own) == found._replace(remedy=field_dose(own).remedy)
        assert "soil cores" in field_dose(own).remedy
        assert not any("mm on" in step for step in irrigation(own).steps)
    wide = dataclasses.replace(the_map, curve=dataclasses.replace(the_map.curve, n0_sd_cps=0.45))
    own = make_run(irrigation=LIMITS, soil_map=wide, sensed=DEEP)
    assert "; more soil cores, on another day, not more counting, could make it up to" in irrigation(own).steps[0]


def test_the_advice_leads_with_the_dose(make_run):
    run = make_run(irrigation=LIMITS, sensed=DEEP)
    found, steps = field_dose(run), irrigation(run).steps
    assert found is field_dose(run)
    area, volume = f"{found.area_m2 / 1e4:.2f} of 0.11 ha", f"({found.volume_m3:.0f} m³)"
    assert steps[0].startswith("Irrigate ")
    surely = sum(zone.need_sure * zone.area_m2 for zone in found.irrigated) / found.area_m2
    assert f"mm on {area} {volume}, need sure on {100 * surely:.0f} % of that" in steps[0]
    assert f"; decision sure on {100 * found.sure:.0f} % of the area" in steps[0]
    assert "are missing to 30.0 % in the upper 300 mm, and 20 % is lost on the way." in steps[1]
    assert not found.below
    about = json.loads(json.dumps(summary(run)["dose"]))
    assert about["certain"] is found.certain
    assert (about["sure_share"], about["need_sure_share"]) == (found.sure, pytest.approx(surely))
    assert about["volume_m3"] == pytest.approx(found.volume_m3)
    assert sum(zone["area_m2"] for zone in about["zones"]) == pytest.approx(1106.5, rel=1e-4)
    for saved, zone in zip(saved_zones({"dose": about}), found.zones, strict=True):
        assert saved.shape.equals(zone.shape)
        assert {**vars(saved), "shape": 0} == {**vars(zone), "shape": 0}
    rows = irrigation(run).doses
    assert [row.dose for row in rows] == [
        "none",
        *(f"{d:g} mm" for d in sorted({z.gross_mm for z in found.irrigated})),
    ]
    for limits, said in ((LIMITS, False), (LIMITS.model_copy(update={"width_m": 90}), True)):
        page = render_report(make_run(irrigation=limits, sensed=DEEP))
        assert ("lacks " in page) is said, "one interval of the missing water"
    assert irrigation(dataclasses.replace(run, simulated=True)).steps[0].startswith("Simulated: ")


@pytest.mark.slow
def test_a_phone_shows_the_whole_dose_and_scrolls_down_only(make_run, tmp_path):
    path = tmp_path / "report.html"
    path.write_text(render_report(make_run(irrigation=LIMITS, sensed=DEEP)))
    with chromium() as browser:
        page = browser.new_page(viewport=PHONE)
        page.goto(path.as_uri())
        page.locator(".chips").wait_for()
        assert page.evaluate("document.documentElement.scrollWidth") == PHONE["width"]
        assert page.locator("#dose + .scroll").evaluate("it => it.scrollWidth <= it.clientWidth")


def test_the_lead_says_what_the_largest_dose_leaves(make_run):
    small = LIMITS.model_copy(update={"max_dose_mm": 10})
    run = make_run(irrigation=small, sensed=DEEP)
    top = [zone for zone in field_dose(run).zones if zone.gross_mm == 10]
    left = sum((zone.net_mm - 0.8 * 10) * zone.area_m2 for zone in top) / sum(zone.area_m2 for zone in top)
    assert (
        f"; 10 mm is the largest dose of the machine, about {left:.0f} mm remain missing; decision sure on"
        in (irrigation(run).steps[0])
    )
    steps = LIMITS.model_copy(update={"max_dose_mm": 13})
    lead = irrigation(make_run(irrigation=steps, sensed=DEEP)).steps[0]
    assert "; 10 mm is the largest dose in steps of 5 mm up to the 13 mm of the machine, about " in lead
    assert "largest dose" not in irrigation(make_run(irrigation=LIMITS, sensed=DEEP)).steps[0]


def test_a_footprint_larger_than_the_field_makes_zones_hints(make_run):
    wide = {"footprint_radius_m": 170.0, "footprint_range_m": (120.0, 220.0)}
    run = make_run(irrigation=LIMITS, sensed=DEEP, **wide)
    default = "default of a bare probe, 120 to 220 m; footprint_radius_m is not given"
    told = f"mean over 170 m around each place ({default})"
    about = summary(run)
    assert about["map"]["support"] == told
    assert about["map"]["resolution_m"] == 170.0
    assert "wide_footprint" in about["warning_codes"]
    assert any(one["name"] == "footprint" and told in one["remark"] for one in about["budget"]["beyond"])
    assert not about["dose"]["certain"]
    assert "one dose for the whole field" in about["dose"]["blurred"]
    assert about["dose"]["blurred"] in irrigation(run).steps
    near = summary(make_run(irrigation=LIMITS, sensed=DEEP, footprint_radius_m=10.0))
    assert "wide_footprint" not in near["warning_codes"]
    assert not near["dose"]["blurred"]


def test_soil_below_the_sensed_depth_is_an_assumption_without_earlier_surveys(make_run):
    shallow = SensedSoil((15.0, 12.0, 18.0), (10.0, 9.0, 11.0))
    found, deep = (field_dose(make_run(irrigation=LIMITS, sensed=sensed)) for sensed in (shallow, DEEP))
    assert found.settings.below_share == pytest.approx(0.5)
    assert found.settings.below_sd == pytest.approx(BELOW_SD_SHARE * 0.18)
    assert "an assumption" in found.below
    assert np.mean(found.dose.p95_mm - found.dose.p05_mm) > np.mean(deep.dose.p95_mm - deep.dose.p05_mm)


def test_earlier_surveys_tell_of_the_soil_below(make_run, the_map):
    now = make_run(irrigation=LIMITS).survey_end_utc.timestamp()
    xy, rate = the_map.samples.xy, float(the_map.curve.rate_cps(0.35))
    counts = np.full(len(xy), round(rate * 1000))

    def earlier(days):
        survey = EarlierSurvey("wet", now - 86400 * days, Samples(xy, counts, np.full(len(xy), 1000.0)))
        return [EarlierRun(survey, Path("wet"), survey.stamp_s, ())]

    shallow = SensedSoil((15.0, 12.0, 18.0), (10.0, 9.0, 11.0))
    runs = [make_run(irrigation=LIMITS, sensed=shallow, earlier=earlier(days)) for days in (5, 400)]
    recent, old = (field_dose(run) for run in runs)
    assert datetime.fromtimestamp(now, UTC).year == 2026
    assert recent.settings.below_shift > 0.03
    assert "From 1 earlier survey the soil below is taken to be" in recent.below
    assert "moister than above" in recent.below
    assert old.settings.below_shift == pytest.approx(0, abs=1e-6)
    assert old.settings.below_sd == pytest.approx(BELOW_SD_SHARE * 0.18)
    assert recent.dose.net_mm.mean() < old.dose.net_mm.mean()


@pytest.mark.parametrize("vwc", [0.19, 0.205, 0.215, 0.23])
def test_the_share_after_more_counts_is_what_draws_of_them_show(the_map, vwc):
    limits = DoseSettings(wilting_point=0.12, field_capacity=0.30, field_capacity_sd=0.01, wilting_point_sd=0.01)
    rate, before, after = np.array([float(the_map.curve.rate_cps(vwc))]), np.array([0.04]), np.array([0.01])
    shown = np.random.default_rng(5).normal(rate, np.sqrt(before - after), 4000)
    needed = find_dose(shown, np.full(4000, np.sqrt(after[0])), the_map.curve, limits).needed
    certain = (np.maximum(needed, 1 - needed) >= CERTAIN).mean()
    assert _Decision(rate, before, the_map.curve, limits).sure(after)[0] == pytest.approx(certain, abs=0.04)


def test_more_counting_is_what_kriging_with_more_counts_would_be(make_run, the_map):
    curve = dataclasses.replace(the_map.curve, n0_sd_cps=1e-9)
    run = make_run(irrigation=LIMITS, sensed=DEEP, soil_map=dataclasses.replace(the_map, curve=curve))
    found = field_dose(run)
    counting = found.remedies[0]
    assert counting.what == "counting"
    assert counting.minutes in MINUTES
    assert found.sure + 0.05 <= counting.share <= 1
    assert f"; {counting.minutes} more minutes of counting" in irrigation(run).steps[0]
    # all of that time at every tenth cell: what that many counts could show at most
    xy, rate = the_map.grid.cells[::10], the_map.rate[the_map.grid.mask][::10]
    exposure = np.full(len(xy), 60.0 * counting.minutes)
    samples = the_map.samples
    kriging = PoissonKriging(the_map.variogram, the_map.keep_nugget, the_map.mean_rate)
    kriging.fit(samples.xy, samples.counts, samples.exposure_s).add(xy, np.round(rate * exposure), exposure)
    variance = kriging.predict(the_map.grid.cells)[1]
    mask = the_map.grid.mask
    most = _Decision(the_map.rate[mask], the_map.variance[mask], curve, found.settings).gain(variance)
    assert counting.share <= found.sure + most + 0.02
