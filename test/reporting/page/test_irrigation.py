# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The farmer's page: irrigation.py."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from soilmoist_ros.pipeline.run import CalibrationInfo
from soilmoist_ros.reporting import mean_moisture
from soilmoist_ros.reporting.page.irrigation import BY_PLANT, RELATIVE, irrigation
from soilmoist_ros.sensing import CountRecord, Irrigation


def names(found):
    return tuple(zone.name for zone in found.zones)


def test_without_limits_the_zones_are_thirds_and_say_so(make_run):
    found = irrigation(make_run())
    assert names(found) == RELATIVE
    assert [zone.share for zone in found.zones] == pytest.approx([1 / 3] * 3, abs=0.02)
    assert sum(zone.area_m2 for zone in found.zones) == pytest.approx(1106.5, rel=1e-6)
    assert "only compare places of this field" in found.basis
    assert found.zones[0].water_mm < found.zones[1].water_mm < found.zones[2].water_mm


def test_available_water_gives_the_stress_point_and_the_missing_water(make_run, the_map):
    # FAO-56 example: field capacity 0.30, wilting point 0.12, p = 0.5: half of 0.18 may be used
    limits = Irrigation(root_depth_mm=500, wilting_point=0.12, field_capacity=0.30)
    assert limits.stress == pytest.approx(0.21)
    found = irrigation(make_run(irrigation=limits))
    assert names(found) == BY_PLANT
    for zone, chosen in zip(found.zones, (found.number == i for i in range(3)), strict=True):
        if chosen.any():
            missing = np.maximum(0.30 - the_map.vwc[chosen], 0).mean() * 500
            assert zone.missing_mm == pytest.approx(missing, abs=9), "a mean over what the moisture may be"
            assert zone.water_mm == pytest.approx(the_map.vwc[chosen].mean() * 500)


def test_a_cell_is_certain_if_it_lies_in_its_zone_four_times_in_five(make_run, the_map):
    found = irrigation(make_run(irrigation=Irrigation(dry_below=0.2, moist_above=0.35)))
    drawn = np.random.default_rng(3).normal(the_map.rate, the_map.rate_sd, (4000, *the_map.rate.shape))
    with np.errstate(invalid="ignore"):
        zone = np.searchsorted([0.2, 0.35], np.nan_to_num(the_map.curve.vwc(drawn), nan=0.4), side="right")
        share = np.mean(zone == found.number, axis=0)
    clear = the_map.grid.mask & (np.abs(share - 0.8) > 0.03)
    assert clear.sum() > 100
    np.testing.assert_array_equal(found.sure[clear], share[clear] >= 0.8)
    assert not found.sure[~the_map.grid.mask].any()
    assert found.sure_share == pytest.approx(found.sure[the_map.grid.mask].mean())


def test_two_limits_of_dry_soil_are_told_once_with_both_numbers(make_run):
    own = {"dry_below": 0.25, "moist_above": 0.35}
    told = irrigation(make_run(irrigation=Irrigation(texture="loam", **own)))
    assert "dry is below 25.0 % here, and plants lack water below 21.0 % there" in told.basis
    assert "21.0 % there" not in irrigation(make_run(irrigation=Irrigation(**own))).basis


def test_a_guessed_calibration_has_no_absolute_zones(make_run):
    limits = Irrigation(dry_below=0.2, moist_above=0.3)
    found = irrigation(make_run(irrigation=limits, calibration=CalibrationInfo(7.0, 1.4, illustrative=True)))
    assert names(found) == RELATIVE
    assert "Illustrative" in found.level
    assert "calibrate" in found.advice
    assert all(math.isnan(zone.missing_mm) for zone in found.zones)


def test_rates_are_zones_from_many_to_few_neutrons(make_run, uncalibrated):
    found = irrigation(make_run(soil_map=uncalibrated, calibration=None))
    driest = uncalibrated.rate[found.number == 0].min()
    assert driest >= uncalibrated.rate[found.number == 2].max()
    assert found.water == ""
    assert "counts/s" in found.zones[0].limits
    assert "Not calibrated" in found.level


def test_water_of_the_root_zone_has_an_interval(make_run, the_map):
    text = irrigation(make_run()).water
    mean = mean_moisture(the_map).value * 300
    assert f"hold {mean:.0f} mm" in text
    low, high = (int(part) for part in text.split("interval ")[1].split(" mm")[0].split(" to "))
    assert low < mean < high
    assert "upper 300 mm" in text


def test_a_probe_at_one_place_says_nothing_of_the_field(make_run, map_of):
    track = [CountRecord(1.7e9 + 900 * i, 0.0, 0.0, 0.0, 4300 - 20 * i, 900.0, 900.0) for i in range(40)]
    found = irrigation(make_run(soil_map=map_of(n=1), track=track))
    assert found.water == ""
    assert found.steps[0].startswith("Next: for a map of the surroundings, drive the sensor over the field")


LIMITS = Irrigation(dry_below=0.21, moist_above=0.30, wilting_point=0.12, field_capacity=0.30, width_m=90)
"""Wider than the field: there is no dose."""


@pytest.fixture
def advised(make_run, the_map):
    """Advice of a field whose west and east have a moisture each, known with a standard deviation of the rate."""

    def advise(west, east, rate_sd, limits=LIMITS, n0_sd=0.001, **changes):
        curve = dataclasses.replace(the_map.curve, n0_sd_cps=n0_sd)
        vwc = np.where(the_map.grid.x_m[None, :] < 0, west, east) + 0 * the_map.rate
        variance = np.full(vwc.shape, rate_sd**2)
        soil = dataclasses.replace(the_map, curve=curve, rate=curve.rate_cps(vwc), variance=variance)
        return irrigation(make_run(soil_map=soil, irrigation=limits, **changes))

    return advise


@pytest.mark.parametrize(
    ("field", "steps"),
    [
        ((0.15, 0.15, 0.05), ["Irrigate the 0.11 ha that are dry (certain on all of it).", "Filling"]),
        ((0.26, 0.26, 0.05), ["No irrigation needed now: no part of the field is dry."]),
        ((0.40, 0.40, 0.02), ["No irrigation needed now: no part of", "Moist on 0.11 ha (certain on"]),
        ((0.205, 0.26, 0.05), ["Dry on 0.06 ha, certain on none of it: count at more places there first (",
                               "No irrigation needed now on the other 0.05 ha."]),
        ((0.15, 0.215, 0.05), ["Irrigate the 0.06 ha that are dry",
                               "Filling their root zone to field capacity takes 45 mm (",
                               "The other 0.05 ha may be dry as well: count at more places there first (mostly"]),
        ((0.214, 0.213, 0.05), ["No part of the field seems dry, but that is certain on none of it: count"]),
        ((0.31, 0.29, 0.05), ["No irrigation needed now: no part", "Moist on 0.06 ha, certain on none of it."]),
        ((0.19, 0.19, 0.01, LIMITS, 0.5), ["Dry on 0.11 ha, certain on none of it: first get more soil"]),
        ((0.10, 0.26, 0.05, Irrigation(dry_below=0.2, moist_above=0.25)),
         ["Irrigate the 0.06 ha that are dry", "With field capacity in the site file",
          "No irrigation needed now on the other 0.05 ha.", "Moist on 0.05 ha"]),
    ],
)  # fmt: skip
def test_advice_of_a_field(advised, field, steps):
    found = advised(*field)
    assert len(found.steps) == len(steps), found.advice
    for step, begin in zip(found.steps, steps, strict=True):
        assert step.startswith(begin)


@given(
    west=st.floats(0.05, 0.45), east=st.floats(0.05, 0.45), rate_sd=st.floats(0.005, 0.6), n0_sd=st.floats(0, 0.5)
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_advice_never_rests_on_a_zone_that_is_not_certain(advised, west, east, rate_sd, n0_sd):
    found = advised(west, east, rate_sd, n0_sd=n0_sd)
    dry, _, wet = found.zones
    assert ("Irrigate" in found.advice) == dry.certainty.certain
    assert ("it needs no water" in found.advice) == wet.certainty.certain
    assert ("No irrigation needed now" in found.advice) == bool(found.not_dry.any())
    assert ("first" in found.advice) == bool(
        (~found.not_dry & np.isfinite(found.number) & ((found.number > 0) | (not dry.certainty.certain))).any()
    )


@pytest.mark.parametrize("share_of_n0", [0.38, 1.5], ids=["full pores", "less than dry"])
def test_no_advice_rests_on_moisture_that_is_impossible(make_run, the_map, share_of_n0):
    n0_cps = float(the_map.rate[the_map.grid.mask].mean()) / share_of_n0
    wrong = dataclasses.replace(the_map, curve=dataclasses.replace(the_map.curve, n0_cps=n0_cps))
    found = irrigation(make_run(soil_map=wrong, irrigation=Irrigation(dry_below=0.2, moist_above=0.3)))
    assert names(found) == RELATIVE
    assert found.advice.startswith("Next: check N0, the bulk density and the tubes that were counted")
    assert found.water == ""
    assert all(math.isnan(zone.water_mm) and "counts/s" in zone.limits for zone in found.zones)
    assert "do not use the percentages" in found.level
