# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Probabilities of false alarms (alarms.py)."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import bdtrc

from soilmoist_ros.sensing.checks.alarms import least_chance

GOOD_RECORDS = """
import sys
import numpy as np
from soilmoist_ros.sensing.checks.totals import TotalChecks
from soilmoist_ros.sensing.records import CountRecord
rng, checks = np.random.default_rng(2), TotalChecks(n0_cps=20.0)
for i in range(1000):
    record = CountRecord(1.7e9 + 10 * i, 3.0 * (i // 20), 0.0, 0.0, int(rng.poisson(40)), 10.0, 10.0)
    assert not checks.check(record)
assert not any(name.startswith("scipy") for name in sys.modules)
"""


@given(st.integers(1, 5000), st.floats(1e-3, 0.999), st.data())
def test_the_lower_limit_is_below_the_probability(total, share, data):
    counts = data.draw(st.integers(0, total))
    exact = bdtrc(counts - 1, total, share) if counts else 1.0
    assert 0.0 <= least_chance(counts, total, share) <= exact * (1 + 1e-9) + 1e-300


@pytest.mark.parametrize("deviation", [1.0, 2.0, 3.0, 4.0])
def test_the_lower_limit_is_near_the_probability(deviation):
    for total in (20, 200, 2000):
        counts = int(np.ceil(0.3 * total + deviation * np.sqrt(0.21 * total)))
        assert least_chance(counts, total, 0.3) > bdtrc(counts - 1, total, 0.3) / 60


def test_good_records_are_checked_without_scipy():
    subprocess.run([sys.executable, "-c", GOOD_RECORDS], check=True)
