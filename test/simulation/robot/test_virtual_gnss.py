# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing.gnss import FixStatus
from soilmoist_ros.sensing.position.nmea import NmeaParser
from soilmoist_ros.sensing.records import Position
from soilmoist_ros.simulation.robot.virtual_devices import VirtualGnss, nmea_sentences

FRAME = LocalFrame(53.2680, -0.5245)
START_S = 1_780_000_000.0


def read(lines):
    parser = NmeaParser()
    fixes = [parser.feed(f"{line}\r\n".encode()) for line in lines]
    fixes.append(parser.flush())
    assert parser.problems == []
    return [fix for fix in fixes if fix is not None]


@settings(deadline=None)
@given(
    st.floats(-89.99, 89.99).filter(lambda value: abs(value) > 1e-8),
    st.floats(-179.99, 179.99),
    st.integers(10**11, 3 * 10**11),
)
def test_written_positions_are_read_back(latitude, longitude, hundredths):
    fix = read(nmea_sentences(hundredths / 100, Position(latitude, longitude, 30.0, 0.02)))[0]
    assert fix.position.latitude_deg == pytest.approx(latitude, abs=2e-9)
    assert fix.position.longitude_deg == pytest.approx(longitude, abs=2e-9)
    assert fix.stamp_s == pytest.approx(hundredths / 100, abs=1e-6)
    assert fix.position.horizontal_sd_m == pytest.approx(0.02)
    assert fix.status is FixStatus.RTK


def test_noise_matches_the_reported_standard_deviation():
    gnss = VirtualGnss(FRAME, START_S, 0.05, np.random.default_rng(1))
    fixes = read([line for second in range(400) for line in gnss.sentences(float(second), (12.0, 34.0))])
    assert len(fixes) == 400
    places = FRAME.to_local([f.position.latitude_deg for f in fixes], [f.position.longitude_deg for f in fixes])
    assert places.mean(axis=0) == pytest.approx([12, 34], abs=4 * 0.05 / 20)
    assert places.std(axis=0) == pytest.approx([0.05, 0.05], rel=4 / np.sqrt(800))


def test_a_lost_fix_has_time_only_and_does_not_change_later_noise():
    def sentences(lost):
        gnss = VirtualGnss(FRAME, START_S, 0.05, np.random.default_rng(1))
        return [gnss.sentences(float(second), (1.0, 2.0), second not in lost) for second in range(6)]

    whole, broken = sentences(()), sentences((2, 3))
    assert whole[4:] == broken[4:]
    # without a fix, a receiver sends no GST: only the next epoch shows that this epoch is complete
    lost = read([line for epoch in broken for line in epoch])[2]
    assert lost.status is FixStatus.NO_FIX
    assert lost.stamp_s == START_S + 2
