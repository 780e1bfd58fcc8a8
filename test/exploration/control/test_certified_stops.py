# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sealed samples (sealed_sample.py), and missions that take their stops in."""

from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.exploration import Stop, Visit, check_places, sample_from_text, state_from_json
from soilmoist_ros.exploration.control.explorer import without_visits
from soilmoist_ros.exploration.mission.mission import Mission
from soilmoist_ros.exploration.mission.state import MissionState
from soilmoist_ros.exploration.mission.types import MissionRules
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.exploration.planning.sealed_sample import draw_sample, drawn
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import FieldGrid, FieldMap
from soilmoist_ros.simulation import MissionSettings, simulate_mission

GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 20), (20, 20), (20, 60), (0, 60)], cell_m=4.0)
STOPS = tuple(Stop(f"s{n}", x, y) for n, (x, y) in enumerate(GRID.cells.tolist()))
SMALL = {"field": "synthetic-low", "hours": 0.6, "cell_m": 5.0, "series_every_s": 1e9, "certify": 5}


def test_each_cell_is_as_likely_and_the_sample_is_spread():
    draws = np.array([drawn(GRID.mask, 5, seed) for seed in range(3000)])
    times = np.bincount(draws.ravel(), minlength=len(STOPS))
    assert times.min() > 0
    assert np.abs(times / times.mean() - 1).max() < 0.35  # 120 draws of each expected: 3.8 standard deviations
    alone = np.random.default_rng(1).integers(len(STOPS), size=draws.shape)

    def nearest_m(cells):
        xy = GRID.cells[cells]
        apart = np.linalg.norm(xy[:, :, None] - xy[:, None], axis=3) + 1e9 * np.eye(5)
        return apart.min(axis=(1, 2)).mean()

    assert nearest_m(draws) > 1.3 * nearest_m(alone)


def test_a_sample_can_be_drawn_again_and_a_changed_one_is_found():
    reached = np.array([stop.x_m > 8 for stop in STOPS])
    sample = draw_sample(GRID, STOPS, reached, 7, 30.0, seed=11)
    again = sample_from_text(sample.text)
    assert (again, again.digest, again.is_as_drawn) == (sample, sample.digest, True)
    assert all(stop.x_m > 8 for stop in sample.stops)
    assert sample.visitable == pytest.approx(reached.mean(), abs=0.01)
    changed = replace(sample, cells=(*sample.cells[:-1], sample.cells[-1] - 1))
    assert not changed.is_as_drawn
    assert changed.digest != sample.digest
    for text in ("", "{}", sample.text.replace(sample.inside, "nothing"), sample.text.replace("[", "", 1)):
        with pytest.raises(InputError, match="not a sealed sample"):
            sample_from_text(text)


@pytest.mark.parametrize(("count", "robots"), [(4, 1), (12, 2)])
def test_a_certificate_of_few_places_or_several_robots_is_refused(count, robots):
    with pytest.raises(InputError, match="certify"):
        check_places(count, robots)
    with pytest.raises(InputError, match="certify"):
        simulate_mission(MissionSettings(certify=count, robots=robots))


@pytest.mark.parametrize(
    ("count", "hours", "remedy"),
    [(300, 0.25, "give at most 6 places, or 9.8 h"), (5, 0.1, "give 0.22 h or more"), (7, 0.25, "at most 6")],
)
def test_a_certificate_that_leaves_no_time_for_the_map_is_refused(count, hours, remedy):
    with pytest.raises(InputError, match=remedy):
        simulate_mission(MissionSettings(field="patches", certify=count, hours=hours))


@pytest.mark.parametrize(
    "choice",
    [{"strategy": "gcb"}, {"strategy": "lattice", "dwell": "fmi:10"}, {"strategy": "random", "travel": "graph"},
     {"strategy": "greedy", "until_gain": 99.0}, {"strategy": "gcb", "person": "obedient"}],
)  # fmt: skip
def test_every_strategy_counts_at_all_places_in_time(choice):
    settings = MissionSettings(**SMALL, **choice)
    result = simulate_mission(settings)
    sample = sample_from_text(result.certificate)
    at = [visit for visit in result.visits if visit.name in sample.names]
    assert {visit.name for visit in at} == sample.names
    assert all(visit.exposure_s >= sample.dwell_s for visit in at[:-1])
    assert len(result.visits) > len(at)
    assert result.series[-1].time_s <= 3600 * settings.hours
    assert sample == sample_from_text(simulate_mission(settings).certificate)


def test_a_plan_knows_nothing_of_the_certified_counts():
    field_map = FieldMap(GRID)
    for x, counts, exposure_s in ((2.0, 40, 10.0), (10.0, 200, 50.0), (30.0, 44, 10.0)):
        field_map.add_sample((x, 2.0), counts, exposure_s)
    field_map.update()

    def visit(x, counts, exposure_s):
        return Visit("s", x, 2.0, 0.0, exposure_s, counts, "", effective_exposure_s=exposure_s)

    blind = without_visits(field_map, [visit(10.1, 160, 40.0), visit(30.0, 44, 10.0)])
    assert blind.samples.counts.tolist() == [40, 40]
    assert blind.samples.exposure_s.tolist() == [10.0, 10.0]
    assert blind.kriging is not None
    assert without_visits(field_map, ()) is field_map


def test_a_mission_that_resumes_keeps_its_sample():
    text = draw_sample(GRID, STOPS, np.ones(len(STOPS), bool), 5, 30.0, seed=2).text
    done = (Visit("s1", 2.0, 2.0, 10.0, 30.0, 120, "certified", effective_exposure_s=30.0),)
    mission = Mission(
        MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:10")), MissionState(certificate=text, certified=done)
    )
    restored = state_from_json(mission.snapshot())
    assert Mission(mission.rules, restored).snapshot() == mission.snapshot()
    assert (restored.certificate, len(restored.certified)) == (text, 1)
    assert mission.status.certificate == text
