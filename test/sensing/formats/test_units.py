# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from soilmoist_ros.sensing.formats.log_values import canonical, converter, rate_of


@pytest.mark.parametrize(
    ("text", "value", "hpa"),
    [("mm Hg", 760, 1013.25), ("Torr", 760, 1013.25), ("[inHg]", 29.92, 1013.2), ("kPa", 101.325, 1013.25)],
)
def test_pressures_of_weather_stations(text, value, hpa):
    assert converter("pressure", canonical(text))(value) == pytest.approx(hpa, abs=0.05)


@pytest.mark.parametrize(
    ("texts", "unit"),
    [
        (["Zählrate [1/h]", "cph", "N_per_hour", "n1 [h^-1]", "Imp./Stunde"], "counts_per_hour"),
        (["CPM", "neutrons_cpm_avg", "counts/min", "per minute", "min⁻¹"], "counts_per_minute"),
        (["neutrons_cps", "counts/s", "Hz", "1/sec"], "counts_per_second"),
        (["N1Cts", "NeutronCount_Epithermal_Cum1h", "counts/15min", "n_per_sample", "MOD"], ""),
    ],
)  # fmt: skip
def test_units_of_rates(texts, unit):
    assert [rate_of(text) for text in texts] == [unit] * len(texts)
