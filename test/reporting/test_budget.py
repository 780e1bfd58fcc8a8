# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import importlib
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.mapping import SoilMap, common_rate_sd, possible_moisture
from soilmoist_ros.pipeline import site_facts
from soilmoist_ros.pipeline.run import CalibrationInfo, CorrectionRow
from soilmoist_ros.reporting import make_budget, summary
from soilmoist_ros.reporting.budget import (
    CORES,
    COUNTING,
    DENSITY,
    MAPPING,
    N0,
    OTHER,
    REMEDIES,
    SOURCES,
    WATER,
    level_parts,
)
from soilmoist_ros.reporting.page.report import render_report
from soilmoist_ros.reporting.page.statistics import band_statistics
from soilmoist_ros.sensing import CalibrationCurve, Site, UncertaintyPart, UniversalCurve

ROOT = Path(__file__).resolve().parents[2]
NAMES = get_args(UncertaintyPart.model_fields["name"].annotation)
SHARES = st.lists(st.tuples(st.sampled_from(NAMES[:9]), st.floats(0.001, 0.08)), unique_by=lambda one: one[0])


def part(name, share=math.nan, origin="given", value=1.0, sd=0.1, unit=""):
    return UncertaintyPart(name=name, value=value, unit=unit, sd=sd, origin=origin, share=share)


def info(curve, *parts, method="general", **about):
    return CalibrationInfo(
        curve.n0_cps, curve.bulk_density_gcm3, curve.n0_sd_cps or None, method=method, parts=parts, **about
    )


def general(make_run, the_map, curve, *parts, **about):
    return make_run(
        soil_map=replace(the_map, curve=curve), calibration=info(curve, *parts, **about), corrections=()
    )


def squares(parts, name):
    return math.sqrt(sum(getattr(one, name) ** 2 for one in parts))


@given(
    shares=SHARES, n0=st.floats(0, 0.09), density=st.sampled_from([0.0, 0.05, 0.2]),
    water=st.sampled_from([0.0, 0.01]), kind=st.sampled_from([CalibrationCurve, UniversalCurve]),
)  # fmt: skip
def test_level_adds_up_to_the_stated_interval(make_run, the_map, shares, n0, density, water, kind):
    n0_cps = 7.0 if kind is CalibrationCurve else 8.0
    curve = kind(n0_cps, 1.4, 0.02, 0.01, n0_cps * n0, density, bound_water_sd=water)
    rate = float(np.nanmean(the_map.rate))
    run = general(make_run, the_map, curve, *(part(*one) for one in shares))
    level, low, high, parts = level_parts(run, curve, rate)
    common = common_rate_sd(curve, np.array([rate]))
    if common is None or common[0] == 0:
        assert math.isnan(level)
        assert not parts
        return
    assert squares(parts, "level_rate_cps") == pytest.approx(common[0], rel=1e-9)
    assert squares(parts, "level") == pytest.approx(level, rel=1e-9)
    away = SoilMap.QUANTILE_SD * squares(parts, "level_rate_cps")
    ends = possible_moisture(curve, [rate + away, rate - away])
    assert (low, high) == pytest.approx(tuple(ends), rel=1e-9)
    assert level == pytest.approx((ends[1] - ends[0]) / 2 / SoilMap.QUANTILE_SD)


def test_place_adds_up_to_the_bands(make_run, the_map):
    found = make_budget(make_run())
    assert found.place_sd == band_statistics(the_map.vwc_sd).p50
    assert squares(found.parts, "place") == pytest.approx(found.place_sd, rel=1e-12)
    assert squares(found.parts, "place_rate_cps") == pytest.approx(found.place_rate_sd_cps, rel=1e-12)
    cell = np.unravel_index(np.nanargmin(np.abs(the_map.rate - found.place_rate_cps)), the_map.rate.shape)
    assert the_map.vwc_sd[cell] == pytest.approx(found.place_sd, rel=0.02)
    # Both columns together are the interval of the place that stands for all.
    common = common_rate_sd(the_map.curve, np.array([found.place_rate_cps]))[0]
    away = SoilMap.QUANTILE_SD * math.hypot(common, squares(found.parts, "place_rate_cps"))
    ends = possible_moisture(the_map.curve, [found.place_rate_cps + away, found.place_rate_cps - away])
    assert (the_map.vwc_p05[cell], the_map.vwc_p95[cell]) == pytest.approx(tuple(ends), rel=1e-12)


def test_first_order_for_small_uncertainties(make_run, the_map):
    """GUM 5.1.3: sensitivity times standard uncertainty, with the derivatives of the curve of Desilets."""
    curve = CalibrationCurve(7.0, 1.4, 0.02, 0.0, 0.007, 0.002, bound_water_sd=0.0003)
    found = make_budget(general(make_run, the_map, curve))
    level = {one.name: one.level for one in found.parts}
    assert level[OTHER if OTHER in level else N0] == pytest.approx(
        -curve.slope([found.rate_cps])[0] * found.rate_cps * 0.001, rel=1e-3
    )
    assert level[DENSITY] == pytest.approx(found.vwc * 0.002 / 1.4, rel=1e-3)
    assert level[WATER] == pytest.approx(1.4 * 0.0003, rel=1e-3)


@pytest.mark.parametrize("kind", [CalibrationCurve, UniversalCurve])
@pytest.mark.parametrize(("sds", "weight"), [((0.0, 1e-5), 1.0), ((1e-4, 0.0), 1.0), ((0.0, 1e-5), 0.7)])
def test_errors_of_the_soil_go_with_n0_of_cores(kind, sds, weight):
    """The shift is that of a calibration with other soil and the same cores; at their moisture there is none."""
    here, vwc = kind(7.0, 1.4, 0.02, 0.01), 0.3
    other = kind(7.0, 1.4 + sds[0], 0.02 + sds[1], 0.01)
    other = replace(other, n0_cps=7.0 * float(here.rate_cps(vwc) / other.rate_cps(vwc)) ** weight)
    per_water, per_density = here.of_cores(vwc, weight)
    named = {"n0_per_bound_water": per_water, "n0_per_density": per_density}
    curve = replace(here, bulk_density_sd_gcm3=sds[0], bound_water_sd=sds[1], **named)
    rate = here.rate_cps([0.1, 0.2, vwc])
    shift = np.abs(other.vwc(rate) - here.vwc(rate))
    assert common_rate_sd(curve, rate) * -here.slope(rate) == pytest.approx(shift, rel=0.01, abs=1e-9)
    assert (shift[2] < 1e-9) == (weight == 1)
    free = common_rate_sd(replace(curve, n0_per_bound_water=0.0, n0_per_density=0.0), rate) * -here.slope(rate)
    assert shift[1] < 0.6 * free[1]
    by_mass = here.of_cores(vwc, by_volume=0.0)
    assert by_mass[1] == 0  # N0 of cores by mass does not depend on the density


def test_parts_are_told_with_their_origin(make_run, the_map):
    curve = CalibrationCurve(7.0, 1.4, 0.02, 0.0, 7 * 0.095, 0.12, bound_water_sd=0.01)
    parts = (
        part("general N0", 0.08, "literature", 2306.0, 127.0, "counts/h"), part("sensitivity", 0.03),
        part(DENSITY, origin="default range", value=1.4, sd=0.12, unit="g/cm3"),
    )  # fmt: skip
    run = general(make_run, the_map, curve, *parts)
    found = make_budget(run)
    assert [one.name for one in found.parts] == [
        COUNTING, MAPPING, "general N0", "sensitivity", OTHER, DENSITY, WATER
    ]  # fmt: skip
    about = {one.name: (one.origin, one.distribution) for one in found.parts}
    assert about[COUNTING] == ("measured", "Poisson")
    assert about["general N0"] == ("literature", "normal")
    assert about[DENSITY] == ("default range", "uniform")
    assert about[WATER] == ("given", "normal")
    assert found.largest == "general N0"
    assert "soil cores" in found.remedy
    page = render_report(run).replace("\u00a0", " ")
    assert "2306 ± 127 counts/h, literature, normal" in page
    assert found.text in page
    assert page.count('id="budget"') == 1


@pytest.mark.parametrize(
    ("soil", "origins"),
    [
        ({"texture": "loam"}, ["default range", "default range"]),
        ({"texture": "loam", "bulk_density_gcm3": 1.3, "bulk_density_sd_gcm3": 0.05}, ["given", "default range"]),
        ({"bulk_density_gcm3": 1.4, "bulk_density_sd_gcm3": 0.05, "clay": 0.2, "bound_water_sd": 0.01},
         ["given", "given"]),
    ],
    ids=["class", "own density", "own soil"],
)  # fmt: skip
def test_no_default_of_a_texture_class_is_called_given(make_run, the_map, soil, origins):
    site = Site(soil=soil, calibration={"n0_cps": 7.0, "n0_sd_cps": 0.1})
    site = Site(**site.model_dump())  # as soilmoist calibrate writes it: with all values
    soil_map = replace(the_map, curve=site.curve)
    found = make_budget(make_run(soil_map=soil_map, calibration=site_facts(site)["calibration"]))
    assert [part.origin for part in found.parts if part.name in ("bulk density", WATER)] == origins


@pytest.mark.parametrize(("total", "shares"), [(0.01, [0.008, 0.006]), (0.05002, [0.04, 0.03])])
def test_parts_beyond_the_total_are_scaled_and_its_rounding_is_no_part(make_run, the_map, total, shares):
    """A combined calibration is surer than its prior, whose parts keep their proportions."""
    curve = CalibrationCurve(7.0, 1.4, n0_sd_cps=7 * total)
    found = make_budget(general(make_run, the_map, curve, part("general N0", 0.04), part("intensity", 0.03)))
    level = {one.name: one.level_rate_cps / found.rate_cps for one in found.parts if one.level}
    assert list(level) == ["general N0", "intensity"]
    assert list(level.values()) == pytest.approx(shares, rel=1e-3)
    assert squares(found.parts, "level") == pytest.approx(found.level_sd)


def test_calibration_without_parts_has_one_row(make_run):
    found = make_budget(make_run())
    assert [one.name for one in found.parts] == [COUNTING, MAPPING, CORES]
    assert make_budget(make_run(calibration=None)).parts[-1].name == N0
    assert make_budget(make_run(simulated=True)).parts[-1].name == CORES
    assert not [one for one in make_budget(make_run(simulated=True)).beyond if "no ± is given" in one.remark]
    assert make_budget(make_run(simulated=True)).text.startswith("In this simulation, the level")


def test_a_level_that_is_a_guess_or_impossible_is_not_known(make_run, the_map):
    """The limits of the soil cut the interval of an impossible one: it would look sure."""
    guess = make_run(calibration=info(the_map.curve, illustrative=True, method="cores"))
    dry = CalibrationCurve(2.5, 1.4, n0_sd_cps=0.2)
    for run, why in (
        (guess, "N0 is a guess"),
        (general(make_run, the_map, dry, part("general N0", 0.08)), "impossible moisture"),
    ):
        found = make_budget(run)
        assert math.isnan(found.level_sd)
        assert why in found.text
        assert found.largest == N0
        assert "soil cores" in found.remedy
        assert all(one.level == 0 for one in found.parts)
    assert '<td class="n">unknown</td>' in render_report(guess)


def test_rate_map_has_a_budget_of_the_rate(make_run, uncalibrated):
    found = make_budget(make_run(soil_map=uncalibrated, calibration=None))
    assert found.unit == "share of the rate"
    assert found.place_sd == pytest.approx(band_statistics(uncalibrated.rate_sd).p50 / found.rate_cps)
    assert squares(found.parts, "place") == pytest.approx(found.place_sd)
    assert found.text.startswith("The rate of a place")
    assert {one.name for one in found.beyond} >= {"pressure", "humidity", "intensity"}
    assert "% of the rate" in render_report(make_run(soil_map=uncalibrated, calibration=None))


def test_what_is_not_in_the_sum_is_named(make_run, the_map):
    rows = [
        CorrectionRow("air pressure", "", {"P0": 1013.0}),
        CorrectionRow("air humidity", "", {}, remark="not applied"),
    ]
    found = {one.name: one for one in make_budget(make_run(corrections=rows)).beyond}
    assert found["pressure"].corrected
    assert not found["humidity"].corrected
    assert not found["intensity"].corrected
    assert found["intensity"].remainder > found["pressure"].remainder > 0
    assert "cancels" in found["intensity"].remark  # N0 of cores has the same errors
    assert found[DENSITY].remark == "no ± is given: bulk_density_sd_gcm3"
    # It is in the sum of a calibration that has it among its parts, and cancels nothing there.
    curve = CalibrationCurve(7.0, 1.4, n0_sd_cps=0.4)
    inside = make_budget(general(make_run, the_map, curve, part("intensity", 0.03), part("general N0", 0.05)))
    assert "intensity" not in {one.name for one in inside.beyond}
    assert not any("cancels" in one.remark for one in inside.beyond)
    assert all(source.open > source.corrected > 0 for source in SOURCES)
    assert set(NAMES) <= set(REMEDIES), "every part has a remedy"


def test_one_place_has_counting_alone(make_run, map_of):
    found = make_budget(make_run(soil_map=map_of(n=1)))
    assert [one.name for one in found.parts] == [COUNTING, CORES]
    assert found.place_sd == found.parts[0].place


def test_summary_has_the_budget(make_run):
    about = json.loads(json.dumps(summary(make_run())))
    assert about["budget"]["unit"] == "m3/m3"
    assert about["budget"]["place_sd"] == pytest.approx(about["map"]["uncertainty_vwc"]["between_places_sd"])
    assert about["budget"]["parts"][0]["name"] == COUNTING
    assert about["properties"][0]["budget"] == about["budget"]


def test_what_the_calibration_leaves_out_is_beyond(make_run, the_map):
    curve = CalibrationCurve(7.0, 1.4, n0_sd_cps=0.4)
    snow = part("snow", math.nan, "default range", math.nan, 0.0, "mm")
    run = general(make_run, the_map, curve, part("general N0", 0.05), snow)
    found = make_budget(run)
    beyond = {one.name: one for one in found.beyond}
    assert "snow" not in {one.name for one in found.parts}
    assert "nothing is known" in beyond["snow"].remark
    assert "does not say" in beyond["corrections"].remark  # this run names no corrections
    assert "nan" not in render_report(run)


@pytest.mark.slow
def test_intervals_are_honest_in_simulation():
    """Sites drawn from the default ranges: 90 % intervals of level, mean and places cover 85 to 95 %."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "scripts"))
        bench = importlib.import_module("dose_comparison")
    found = bench.coverage("general, default ranges", 200)
    for share in (found.level, found.mean, found.places):
        assert 0.85 <= share <= 0.95
