# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Missions that count several properties."""

import json
from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.reporting.outputs import write_mission
from soilmoist_ros.simulation import MissionSettings, simulate_mission
from soilmoist_ros.simulation.mission import channel

QUICK = MissionSettings(
    hours=0.25, cell_m=4.0, map_from="records", fit="reml", model="matern32", seed=3, preset="paper"
)
LOOKS_AHEAD = replace(QUICK, strategy="gcb", dwell="optimal")


def course(result):
    def shared(row):
        return row.time_s, row.distance_m, row.samples, row.counting_s, row.errors[0]

    return [*map(shared, result.series)], list(result.visits), list(result.records)


@pytest.mark.slow
@pytest.mark.parametrize("settings", [LOOKS_AHEAD, replace(QUICK, map_from="stops", dwell="fmi:60")])
def test_a_property_without_weight_changes_nothing_of_the_first(settings):
    alone, both = simulate_mission(settings), simulate_mission(replace(settings, properties=("rough:0",)))
    np.testing.assert_equal(course(both), course(alone))
    assert len(alone.properties) == 1
    assert both.properties[1].soil_map is not None
    assert len(both.properties[1].records) == len(both.records)


@pytest.mark.slow
def test_the_second_property_is_counted_where_and_when_the_first_is():
    result = simulate_mission(replace(LOOKS_AHEAD, properties=("rough",), robots=2))
    further = result.properties[1]
    assert further.title == "A rough random field"
    for first, second in zip(result.records, further.records, strict=True):
        assert (first.stamp_s, first.x_m, first.y_m) == (second.stamp_s, second.x_m, second.y_m)
    samples, other = result.soil_map.samples, further.soil_map.samples
    np.testing.assert_array_equal(samples.xy, other.xy)
    assert not np.array_equal(samples.counts, other.counts)
    error = further.soil_map.rate - further.truth_rate
    assert result.series[-1].errors[1].mse == pytest.approx(np.nanmean(error**2), rel=1e-6)


@pytest.mark.slow
def test_a_map_of_stops_has_the_counts_of_the_stops():
    result = simulate_mission(replace(QUICK, map_from="stops", dwell="fmi:60", properties=("rough",)))
    further = result.properties[1]
    first, second = result.soil_map.samples, further.soil_map.samples
    np.testing.assert_array_equal(first.counts, [visit.raw_counts for visit in result.visits])
    np.testing.assert_array_equal(first.exposure_s, second.exposure_s)
    stamps_s = np.array([record.stamp_s for record in further.records])
    counts = np.array([record.raw_counts for record in further.records])
    for visit, counted in list(zip(result.visits, second.counts, strict=True))[:-1]:  # the last is cut short
        begin_s, end_s = visit.arrived_s + 10.0 - 1e-6, visit.arrived_s + visit.dwell_s + 1e-6
        assert counted == counts[(stamps_s >= begin_s) & (stamps_s <= end_s)].sum()


@pytest.mark.slow
def test_what_is_planned_for_both_is_another_plan_and_the_outputs_say_so(tmp_path):
    one, both = (simulate_mission(replace(LOOKS_AHEAD, hours=0.15, properties=(f"rough:{w}",))) for w in (0, 1))
    assert [visit.name for visit in one.visits] != [visit.name for visit in both.visits]
    assert all(";" not in visit.reason for visit in both.visits)
    write_mission(tmp_path, both)
    about = json.loads((tmp_path / "summary.json").read_text())["mission"]
    assert about["also"]["field"] == "A rough random field"
    assert about["also"]["truth"]["rmse_cps"] == pytest.approx(about["final"]["also_mse"] ** 0.5, rel=1e-6)
    head = (tmp_path / "series.csv").read_text().splitlines()[0]
    assert head.endswith(",counting_s,also_mse,mse_rough,also_coverage95,coverage95_rough")
    report = (tmp_path / "report.html").read_text()
    for said in ("A rough random field: Neutron rate", "planned for with the weight 1"):
        assert said in report


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"properties": ("patches",)}, "'patches' of a property does not cover the field 'synthetic-high'"),
        ({"properties": ("validation",), "field": "synthetic-low"}, ""),
        ({"properties": ("ruogh",)}, "did you mean 'rough'"),
        ({"properties": ("rough", "smooth", "rough:2")}, "two properties have the name 'rough'"),
    ],
)
def test_what_does_not_fit_together_is_refused(change, said):
    settings = replace(QUICK, hours=0.02, **change)
    if not said:
        simulate_mission(settings)  # a larger field lies around a smaller one
        return
    with pytest.raises(InputError, match=said):
        simulate_mission(settings)


@pytest.mark.slow
def test_maps_of_some_cells_lead_to_the_same_mission_and_nearly_the_same_errors(monkeypatch):
    settings = MissionSettings(field="rough", cell_m=1.0, hours=0.4)
    some = simulate_mission(settings)
    monkeypatch.setattr(channel, "planning_grid", lambda grid: grid)
    every = simulate_mission(settings)
    assert some.visits == every.visits
    np.testing.assert_allclose(some.soil_map.rate, every.soil_map.rate, rtol=1e-9)
    assert some.series[-1].errors[0].mse == pytest.approx(every.series[-1].errors[0].mse, rel=1e-6)
    mse, of_every = (np.array([row.errors[0].mse for row in each.series[2:]]) for each in (some, every))
    np.testing.assert_allclose(mse, of_every, rtol=0.06)
