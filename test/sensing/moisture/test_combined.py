# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""N0 of several sources: weights, common errors, and what must not be counted twice."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation import InputError
from soilmoist_ros.sensing.moisture.combined import (
    DAY_SD,
    GENERAL_SD,
    N0Source,
    combine_n0,
    difference_sd,
    earlier_source,
)
from soilmoist_ros.sensing.moisture.site import Site, UncertaintyPart

SDS = st.floats(0.002, 0.3)
RATES = st.floats(0.2, 5.0)


@settings(max_examples=40)
@given(st.lists(st.tuples(RATES, SDS, st.floats(0, 1)), min_size=1, max_size=4))
def test_the_combination_is_never_less_sure_than_the_best_source_and_its_shares_add_up(found):
    common = 0.9 * min(sd for _, sd, _ in found)  # one common error
    sources = [N0Source("one", n0, sd, common * (share > 0.5)) for n0, sd, share in found]
    both = combine_n0(sources)
    assert both.sd <= min(source.sd for source in sources) * (1 + 1e-9)
    assert math.hypot(*both.shares) == pytest.approx(both.sd)
    assert sum(both.weights) == pytest.approx(1)
    levels = [source.n0_cps for source in sources]
    assert min(levels) * (1 - 1e-9) <= both.n0_cps <= max(levels) * (1 + 1e-9)


def test_simulated_sites_lie_within_the_stated_error():
    rng = np.random.default_rng(5)
    errors = []
    for _ in range(500):
        here, there = GENERAL_SD * rng.standard_normal(2)  # log N0 of the sites; the general one is 0
        general = N0Source(
            "general", math.exp(0.03 * rng.standard_normal()), math.hypot(0.03, GENERAL_SD), GENERAL_SD
        )
        elsewhere = math.exp(there + 0.01 * rng.standard_normal())
        before = N0Source("earlier", elsewhere, math.hypot(0.01, GENERAL_SD, GENERAL_SD), GENERAL_SD)
        cores = N0Source("cores", math.exp(here + 0.04 * rng.standard_normal()), 0.04)
        both = combine_n0([cores, general, before])
        errors.append((math.log(both.n0_cps) - here) / both.sd)
    assert np.std(errors) == pytest.approx(1, abs=0.08)


def test_many_good_cores_are_the_result():
    cores = N0Source("cores", 1.1, 0.004)
    both = combine_n0([cores, N0Source("general", 1.0, 0.06, 0.055)])
    assert abs(math.log(both.n0_cps / cores.n0_cps)) < 0.5 * cores.sd
    assert both.weights[0] > 0.99
    assert difference_sd(cores, N0Source("", 1.0, 0.06)) == pytest.approx(1.585, abs=0.01)


HERE = {"latitude_deg": 52.0, "longitude_deg": 13.0, "altitude_m": 50}
FILE = Path("before.yaml")


def site(n0_cps=1.0, place=HERE, **calibration):
    return Site(location=place, calibration={"n0_cps": n0_cps, **calibration})


def test_of_a_combined_calibration_before_only_its_cores_count():
    cores = UncertaintyPart(name="cores", value=1.2, unit="counts/s", sd=0.06, origin="measured", share=0.03)
    both = earlier_source(site(n0_sd_cps=0.02, method="combined", parts=[cores]), FILE, site(), [], None)
    assert (both.n0_cps, both.sd) == (1.2, pytest.approx(math.hypot(0.05, DAY_SD)))


@pytest.mark.parametrize(
    ("before", "message"),
    [
        (Site(location=HERE), "has no calibration"),
        (site(illustrative=True), "or a guess"),
        (site(n0_sd_cps=0.1, method="general"), "counted already"),
        (site(n0_sd_cps=0.1, method="combined"), "counted already"),
        (site(n0_sd_cps=0.1, curve="universal"), "of the curve universal"),
        (site(), "no n0_sd_cps"),
        (site(n0_sd_cps=0.1, place=None), "not known whether it is the same site"),
        (site(n0_sd_cps=0.1, date="2025-04-01, 2026-05-01"), "count twice"),
    ],
)
def test_what_cannot_be_combined_is_named(before, message):
    with pytest.raises(InputError, match=message):
        earlier_source(before, FILE, site(), ["2026-05-01"], lambda: 1.0)
