# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from soilmoist_ros.sensing import Track, load_site, process_logs, read_log, read_positions
from virtual_survey import serpentine, simulate_log, stop_and_go, write_survey

pytestmark = pytest.mark.slow  # the survey that all use takes long to make


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    folder = tmp_path_factory.mktemp("survey")
    field = write_survey(folder, seed=3)
    log = read_log(folder / "survey.log", "thorvald_crs")
    fixes, problems = read_positions(folder / "survey.nmea")
    assert not problems
    processed = process_logs([log], load_site(folder / "site.yaml"), field.frame, Track(fixes))
    return field, log, processed


def test_all_records_reach_the_counts(survey):
    field, log, processed = survey
    assert log.simulated
    trajectory = stop_and_go(serpentine(field.polygon, 10.0), 120.0)
    written = simulate_log(field, trajectory, np.random.default_rng(3)).records
    assert len(processed.records) == len(written)
    assert [record.raw_counts for record in processed.records] == [int(sum(r.tube_counts)) for r in written]


def test_records_have_the_positions_of_the_robot(survey):
    field, _, processed = survey
    trajectory = stop_and_go(serpentine(field.polygon, 10.0), 120.0)
    middle = 10.0 * np.arange(len(processed.records)) + 5.0
    np.testing.assert_allclose(processed.xy_m, trajectory.at(middle), atol=0.12)


def test_the_correction_removes_the_effect_of_the_weather(survey):
    field, _, processed = survey
    expected = field.rate_at(processed.xy_m) * processed.effective_exposure_s
    # Pearson's statistic of Poisson counts is about chi-square with n degrees of freedom.
    n = len(processed.records)
    chi_square = ((processed.raw_counts - expected) ** 2 / expected).sum()
    assert abs(chi_square - n) < 4 * np.sqrt(2 * n)
    assert processed.raw_counts.sum() == pytest.approx(expected.sum(), rel=4 / np.sqrt(expected.sum()))
