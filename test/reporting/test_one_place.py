# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A stationary probe end to end: the public record of a station in Kansas."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros.cli.map import _print_summary as print_summary
from soilmoist_ros.foundation.configuration import resource
from soilmoist_ros.pipeline import MapRun, MapSettings, NoteCode, map_logs
from soilmoist_ros.reporting import at_one_place, notes
from soilmoist_ros.reporting.one_place import moisture_of_all
from soilmoist_ros.reporting.page.report import render_report
from soilmoist_ros.sensing import Irrigation, Site, process_logs, read_log

STATION = Path(__file__).parents[2] / "examples" / "station_kansas_2021-10.dat"
HOUR = 3600.0
MIDNIGHT_S = 1634882400  # local time, 22 October


@pytest.fixture(scope="module")
def run() -> MapRun:
    return map_logs([STATION], MapSettings(site=resource("sites", "station_kansas")))


@pytest.mark.slow
def test_the_corrections_agree_with_crnpy() -> None:
    # crnpy was run on the eight records of 22 October until 16:00 (local time), with P0 976 hPa and L 130.
    pressure = {"beta_per_hpa": 1 / 130, "reference_hpa": 976.0}
    site = Site(corrections={"pressure": pressure}, logger_utc_offset_hours=-6)
    log = read_log(STATION, utc_offset_hours=site.logger_utc_offset_hours)
    records = [r for r in process_logs([log], site).records if 8 * HOUR < r.stamp_s - MIDNIGHT_S <= 16 * HOUR]
    assert np.mean([1 / record.f_pressure for record in records]) == pytest.approx(1.111694993011282, rel=1e-12)
    assert np.mean([record.f_humidity for record in records]) == pytest.approx(1.0455073869559603, rel=2e-3)
    assert np.mean([r.corrected_rate for r in records]) == pytest.approx(0.42961513959596065, rel=2e-3)


@pytest.mark.slow
def test_one_place_gives_a_mean_and_says_so(run, capsys) -> None:
    assert at_one_place(run)
    assert run.title == "Moisture at one place"
    assert len(run.track) == 263
    assert not run.quarantined
    # Tube 2 twice has half as many counts again as tube 1 expects.
    assert [note.code for note in notes(run)] == [NoteCode.BAD_TUBES, NoteCode.OVERDISPERSED, NoteCode.ONE_PLACE]
    mean = moisture_of_all(run.track, run.soil_map.curve)
    assert mean.vwc_p05 < mean.vwc < mean.vwc_p95
    print_summary(run)
    assert f"mean {mean.rate:.4f} +- {mean.rate_sd:.4f} counts/s" in capsys.readouterr().out  # not that of a cell
    # The cores of 22 October, and 50 mm of rain from the evening of the 26th on.
    day = [record for record in run.track if 0 < record.stamp_s - MIDNIGHT_S <= 24 * HOUR]
    rain = [record for record in run.track if record.stamp_s > MIDNIGHT_S + 120 * HOUR]
    of_day, of_rain = (moisture_of_all(some, run.soil_map.curve) for some in (day, rain))
    assert of_day.vwc == pytest.approx(0.292, abs=0.01)
    assert of_rain.vwc_p05 > of_day.vwc
    page = render_report(run).replace("\u00a0", " ")
    assert "Moisture at one place" in page
    assert "the moisture is known to ±" in page.lower()
    for text in ("The map</h2>", "measure at more places", 'id="zones"'):
        assert text not in page


def test_a_reference_far_from_the_pressure_of_the_place_is_noted(run) -> None:
    row = replace(run.corrections[0], parameters={"beta [1/hPa]": 0.0077, "P0 [hPa]": 1013.25}, mean_factor=0.69)
    far = replace(run, corrections=[row])
    (note,) = [note for note in notes(far) if note.code is NoteCode.FAR_REFERENCE_PRESSURE]
    assert "48 hPa below the reference of 1013 hPa" in note.message
    for hpa, noted in ((1013.25, False), (960.0, True)):  # that which N0 was found with
        known = replace(far, calibration=replace(run.calibration, method="combined", reference_hpa=hpa))
        assert (NoteCode.FAR_REFERENCE_PRESSURE in [note.code for note in notes(known)]) == noted
    shallow = notes(replace(run, irrigation=Irrigation(root_depth_mm=60)))
    assert any(note.code is NoteCode.SHALLOW_ROOTS and "600 if it is in cm" in note.message for note in shallow)
