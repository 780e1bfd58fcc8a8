# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A public record of a stationary probe with noisy tubes: what remains after the tests of counts."""

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros.sensing import CalibrationCurve, Kind, LoggerFormat, Site, process_logs, read_log

DATA = Path(__file__).parents[2] / "data" / "noisy_station.csv"
LOGGER = LoggerFormat.model_validate(
    {
        "title": "station",
        "source": "a test",
        "header": {
            "columns": ["time", "pressure", "humidity", "temperature", "inside", "battery", "n1", "n2", "n3"]
        },
        "time": {"columns": ["time"], "formats": ["%m/%d/%Y %H:%M"]},
        "counts": {"columns": ["n{tube}"]},
        "live_time": {"from_stamps": True},
        "record_period": {"default_s": 3600},
        "pressure": {"sensors": [{"column": "pressure", "unit": "hPa"}]},
        "temperature": {"sensors": [{"column": "temperature"}]},
        "humidity": {"sensors": [{"column": "humidity"}]},
    }
)
SITE = Site(
    location={"latitude_deg": 39.1106, "longitude_deg": -96.613},
    corrections={"pressure": {"beta_per_hpa": 1 / 130, "reference_hpa": 979.0}},
)
# crnpy was run on these records: counts outside its limits are replaced from their neighbours.
CRNPY_CPS = 0.6614040529524622


@pytest.mark.slow
def test_a_noisy_tube_does_not_change_the_rate() -> None:
    log = read_log(DATA, LOGGER)
    assert log.records_lost == 0
    noisy = sum(np.nanmax(record.tube_counts) > 2000 for record in log.records)
    assert noisy > 60
    survey = process_logs([log], SITE)
    rate_cps = sum(record.raw_counts for record in survey.records) / sum(
        record.effective_exposure_s for record in survey.records
    )
    assert rate_cps == pytest.approx(CRNPY_CPS, rel=0.01)
    believed = sum(np.nansum(record.tube_counts) for record in log.records)
    exposure_s = sum(record.tube_live_s[0] for record in log.records)
    assert believed / exposure_s > 1.5 * rate_cps
    assert np.max([record.corrected_rate for record in survey.records]) < 1.4 * rate_cps


@pytest.mark.slow
def test_the_noise_is_listed_with_its_reason_and_the_index_of_dispersion() -> None:
    survey = process_logs([read_log(DATA, LOGGER)], SITE)
    found = Counter((problem.kind, problem.consequence) for problem in survey.problems)
    assert found[Kind.NOISY_TUBE, "kept"] > 100
    assert found[Kind.OVERDISPERSED, "kept"] == 1
    assert "the other tubes expect" in str(next(p for p in survey.problems if p.kind is Kind.NOISY_TUBE))
    index = re.search(r"dispersion is (\S+) as recorded and (\S+) without", str(survey.problems[-1]))
    assert index is not None
    assert float(index[1]) > 200
    assert float(index[2]) < 3


@pytest.mark.slow
def test_the_moisture_is_that_of_the_good_counts() -> None:
    """N0, bulk density and lattice water of this probe: Patrignani et al. 2021, Frontiers in Water 3:673185."""
    curve = CalibrationCurve(3767 / 3600, 1.33, lattice_water=0.034, organic_water=0.01)
    survey = process_logs([read_log(DATA, LOGGER)], SITE)
    moisture = np.mean([curve.vwc(record.corrected_rate) for record in survey.records])
    assert moisture == pytest.approx(curve.vwc(CRNPY_CPS), abs=0.012)
