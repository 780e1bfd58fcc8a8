# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Irrigation dose: dose.py."""

from __future__ import annotations

import dataclasses
import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon, box, union_all

from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping.soil_map import possible_moisture
from soilmoist_ros.reporting.dose import DoseSettings, find_dose, saved_zones, sure_share, zones_of_dose
from soilmoist_ros.reporting.workable import swaths
from soilmoist_ros.sensing import CalibrationCurve

CURVE = CalibrationCurve(7.0, 1.4, 0.02, n0_sd_cps=0.15)
LOAM = DoseSettings(wilting_point=0.14, field_capacity=0.28, root_depth_mm=400, efficiency=0.8)
"""Plants lack water below 0.21."""


def changed(one=LOAM, **values):
    return DoseSettings(**{**one.model_dump(), **values})


UNSURE = changed(wilting_point_sd=0.03, field_capacity_sd=0.04, below_share=0.5, below_shift=0.02, below_sd=0.03)


def drawn(rate, rate_sd, one, count=40_000):
    """Moisture of the root zone, limit of stress and target of one place, drawn from all errors."""
    rng = np.random.default_rng(7)
    sd = math.hypot(rate_sd, rate * CURVE.n0_sd_cps / CURVE.n0_cps)
    vwc = possible_moisture(CURVE, rng.normal(rate, sd, count))
    vwc += one.below_share * rng.normal(one.below_shift, one.below_sd, count)
    alike = rng.normal(size=count)
    full = one.full + alike * (one.field_capacity_sd or 0)
    error = (1 - one.depletion) * (one.field_capacity_sd or 0) + one.depletion * (one.wilting_point_sd or 0)
    return vwc, one.stress + alike * error, full


@pytest.mark.parametrize("vwc", [0.13, 0.2, 0.22, 0.27, 0.33])
@pytest.mark.parametrize("one", [LOAM, UNSURE], ids=["known soil", "typical soil"])
def test_figures_of_a_place_are_those_of_its_distribution(vwc, one):
    rate, rate_sd = float(CURVE.rate_cps(vwc)), 0.15
    found = find_dose(np.array([rate]), np.array([rate_sd]), CURVE, one)
    water, stress, full = drawn(rate, rate_sd, one)
    missing = 400 * np.maximum(full - water, 0)
    assert found.net_mm[0] == pytest.approx(missing.mean(), abs=0.4)
    assert found.needed[0] == pytest.approx((water < stress).mean(), abs=0.012)
    low, high = np.quantile(missing, [0.05, 0.95])
    assert found.p05_mm[0] == pytest.approx(low, abs=1.5)
    assert found.p95_mm[0] == pytest.approx(high, abs=1.5)
    if one is LOAM:
        gross = np.where(water < stress, np.maximum(np.round(missing / 0.8 / 5), 1) * 5, 0)
        for step in (0.0, 35.0, 45.0, 60.0):
            right = (gross >= 60 if step == 60 else gross == step).mean()
            assert found.right(step)[0] == pytest.approx(right, abs=0.015)


def test_what_is_missing_on_average_is_more_than_what_the_mean_lacks():
    rate = CURVE.rate_cps(np.array([0.30]))
    assert find_dose(rate, np.array([0.3]), CURVE, LOAM).net_mm[0] > 3
    exact = dataclasses.replace(CURVE, n0_sd_cps=0.0)
    assert find_dose(rate, np.array([1e-6]), exact, LOAM).net_mm[0] == pytest.approx(0, abs=0.01)
    dry = find_dose(exact.rate_cps(np.array([0.18])), np.array([1e-6]), exact, LOAM)
    assert dry.net_mm[0] == pytest.approx(40, abs=0.05)  # 0.10 in 400 mm
    assert (dry.needed[0], dry.right(50.0)[0]) == (1, 1)  # 40 mm at 80 %
    part = find_dose(exact.rate_cps(np.array([0.18])), np.array([1e-6]), exact, changed(target_share=0.75))
    assert part.net_mm[0] == pytest.approx(0.065 * 400, abs=0.05)  # to 0.14 + 0.75 * 0.14


def test_a_target_above_the_pore_volume_is_refused():
    with pytest.raises(InputError, match=r"above the pore volume of 0\.47 m3/m3"):
        find_dose(np.array([4.0]), np.array([0.1]), CURVE, changed(target=0.5, field_capacity=0.5))


FIELD = Polygon([(0, 0), (60, 0), (60, 30), (20, 40), (0, 40)], [[(25, 10), (35, 10), (35, 18), (25, 18)]])


def field_dose(vwc_of, one, rate_sd=0.1, field=FIELD):
    """Dose and places of a field of a moisture by place, cells of 1 m."""
    from shapely import contains_xy

    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(60) + 0.5, np.arange(40) + 0.5))
    inside = contains_xy(field, x, y)
    xy = np.column_stack([x, y])[inside]
    rate = CURVE.rate_cps(np.clip(vwc_of(*xy.T), 0.02, 0.45))
    return find_dose(rate, np.full(len(xy), rate_sd), CURVE, one), xy


@pytest.mark.slow
@given(
    seed=st.integers(0, 99),
    width=st.sampled_from([4.0, 7.0, 12.0, None]),
    angle=st.sampled_from([None, 0, 35, 300]),
)
@settings(deadline=None, max_examples=25)
def test_zones_are_the_field_and_none_is_too_small(seed, width, angle):
    one = changed(width_m=width, direction_deg=angle, min_zone_ha=0.015)
    wave = np.random.default_rng(seed).uniform(0.05, 0.4, 2)
    dose, xy = field_dose(lambda x, y: 0.2 + 0.1 * np.sin(wave[0] * x) * np.cos(wave[1] * y), one)
    zones = zones_of_dose(dose, xy, 1.0, FIELD, one)
    assert sum(zone.area_m2 for zone in zones) == pytest.approx(FIELD.area, rel=1e-4)
    assert union_all([zone.shape for zone in zones]).symmetric_difference(FIELD).area < 0.5
    assert {zone.gross_mm for zone in zones} <= {0.0, *one.doses_mm.tolist()}
    assert [zone.number for zone in zones] == sorted(zone.number for zone in zones)
    for one, other in combinations(zones, 2):
        assert one.gross_mm != other.gross_mm or one.shape.intersection(other.shape).length < 0.01
    for zone in zones:
        assert zone.shape.geom_type == "Polygon"
        assert zone.area_m2 >= 150 - 0.5 or len(zones) == 1
        assert zone.volume_m3 == pytest.approx(zone.gross_mm * zone.area_m2 / 1000)
        assert 0 <= min(zone.sure, zone.needed) <= max(zone.sure, zone.needed) <= 1
        assert zone.p05_mm <= zone.net_mm <= zone.p95_mm


def test_no_zone_of_a_rectangle_is_narrower_than_the_machine():
    field, one = box(0, 0, 60, 40), changed(width_m=7.0, direction_deg=0.0, min_zone_ha=0.001)
    dose, xy = field_dose(lambda x, y: 0.2 + 0.1 * np.sin(x / 4) * np.sin(y / 5), one, field=field)
    zones = zones_of_dose(dose, xy, 1.0, field, one)
    assert len(zones) > 5
    assert not any(zone.shape.buffer(-3.49).is_empty for zone in zones)


def test_the_dry_side_gets_the_dose_that_it_lacks():
    one = changed(width_m=10.0, direction_deg=0.0)
    dose, xy = field_dose(lambda x, _: np.where(x < 30, 0.17, 0.26), one, 0.02)
    wet, dry = zones_of_dose(dose, xy, 1.0, FIELD, one)
    assert (wet.number, wet.gross_mm, dry.number, dry.gross_mm) == (1, 0.0, 2, 55.0)  # 44 mm at 80 %
    assert dry.area_m2 == pytest.approx(FIELD.intersection(box(0, 0, 30, 40)).area, abs=1)
    assert wet.volume_m3 + dry.volume_m3 == pytest.approx(dry.area_m2 * 0.055)
    assert min(wet.sure, dry.needed, sure_share(dose)) > 0.85
    limited = changed(one, max_dose_mm=30.0, min_dose_mm=12.0, steps_mm=4.0)
    assert limited.doses_mm.tolist() == [12, 16, 20, 24, 28]
    assert zones_of_dose(dose, xy, 1.0, FIELD, limited)[-1].gross_mm == 28


def test_a_machine_wider_than_the_field_is_refused():
    one = changed(width_m=50.0)
    dose, xy = field_dose(lambda x, _: 0.2 + 0 * x, one)
    with pytest.raises(InputError, match=r"of 50 m is wider than the field of 40 m"):
        zones_of_dose(dose, xy, 1.0, FIELD, one)


def test_a_narrow_machine_has_blocks_of_several_swaths():
    assert swaths(FIELD, 100.0, 1.0, 0.3, None)[2] == pytest.approx(1.2)
    assert swaths(FIELD, 100.0, 0.1, 0.3, None)[2] == pytest.approx(0.9)  # 2200 m2 in at most 4000 blocks
    along, across, _ = swaths(FIELD, 100.0, 1.0, None, 90)
    assert (*along, *across) == pytest.approx((1, 0, 0, -1), abs=1e-9)


def test_a_run_without_a_dose_says_what_it_lacks():
    with pytest.raises(InputError, match="there is no dose: the sensor is not calibrated"):
        saved_zones({"dose": {"missing": "the sensor is not calibrated", "remedy": "calibrate", "settings": None}})
    with pytest.raises(InputError, match="without doses"):
        saved_zones({})


def test_less_than_half_of_the_smallest_dose_is_not_applied_nor_called_right():
    """A shallow root zone lacks 7 mm at most, and the machine cannot give less than 40 mm."""
    shallow = changed(root_depth_mm=50, steps_mm=40.0, max_dose_mm=80.0, efficiency=1.0)
    xy = np.array([(x + 0.5, y + 0.5) for x in range(20) for y in range(20)])
    found = find_dose(np.full(len(xy), float(CURVE.rate_cps(0.15))), np.full(len(xy), 0.05), CURVE, shallow)
    assert found.needed.min() > 0.9
    assert 0 < found.net_mm.max() < 7.1
    (zone,) = zones_of_dose(found, xy, 1.0, box(0, 0, 20, 20), shallow)
    assert zone.gross_mm == 0
    assert zone.sure > 0.99
    assert found.right(40.0).max() < 0.01
    assert sum(found.right(step) for step in (0.0, *shallow.doses_mm)) == pytest.approx(np.ones(len(xy)), abs=1e-6)
