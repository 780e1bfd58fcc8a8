# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Several properties at once: their falls add up, and where one alone matters, the plan is that of one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.exploration import STRATEGIES, Explorer, RequestPlan, cell_stops, make_strategy, warm_up
from soilmoist_ros.exploration.mission.types import MissionRules, PlanKind
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.exploration.planning.properties import Property, property_name, property_weights, variation
from soilmoist_ros.exploration.travel.travel import FreeTravel, RobotMotion
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping import FieldGrid, FieldMap, Variogram, estimate_variogram
from soilmoist_ros.mapping.samples import as_samples

GRID = FieldGrid.from_polygon(np.array([[0, 0], [40, 0], [40, 20], [0, 20]], float), 2.5)
STOPS = cell_stops(GRID)
LATTICE = [(x, y) for x in (3.0, 11.0, 19.0, 27.0, 35.0) for y in (4.0, 16.0)]
FIT = estimate_variogram(
    np.array(LATTICE), [250, 300, 350, 380, 300, 260, 420, 500, 480, 300], [100.0] * 10, extent_m=40.0
)


def field_map(places=LATTICE, rate=4.0, seed=0, sill=1.0, range_m=8.0, nugget=0.01):
    rng = np.random.default_rng(seed)
    exposure_s = np.full(len(places), 100.0)
    found = FieldMap(GRID)
    variogram = Variogram("matern32", nugget * rate**2, range_m, sill * rate**2 / 16)
    samples = as_samples(places, rng.poisson(rate * exposure_s), exposure_s)
    found.set_samples(samples, replace(FIT, variogram=variogram, mean_rate=rate))
    found.update()
    return found


def explorer(strategy, properties=(), first=None, dwell="optimal", seed=0):
    return Explorer(
        [Property(first or field_map()), *properties], STOPS, FreeTravel(RobotMotion()), make_strategy(strategy),
        warm_up(strategy, "paper")[1], MissionRules(budget_s=7200, dwell=parse_dwell(dwell)),
        np.random.default_rng(seed),
    )  # fmt: skip


def plan(strategy, properties=(), first=None, dwell="optimal", seed=0, place=(20.0, 10.0)):
    request = RequestPlan(1, PlanKind.EXPLORE, (), 7200.0, 7200.0)
    return explorer(strategy, properties, first, dwell, seed).plan(request, place)


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(
    strategy=st.sampled_from(STRATEGIES.names()),
    dwell=st.sampled_from(["ami:0.05", "optimal"]),
    seed=st.integers(0, 99),
)
def test_a_property_without_weight_or_map_changes_nothing(strategy, dwell, seed):
    for unimportant in (Property(field_map(seed=seed), 0.0), Property(FieldMap(GRID), 1.0)):
        assert plan(strategy, [unimportant], dwell=dwell, seed=seed) == plan(strategy, dwell=dwell, seed=seed)


@pytest.mark.parametrize("strategy", ["greedy", "gcb"])
def test_the_unit_of_a_property_does_not_matter(strategy):
    """A hundred times the rate, counted for a hundredth of the time, is the same knowledge in another unit."""
    first, rng = field_map(), np.random.default_rng(5)
    counts, few = rng.poisson(400.0, 6), LATTICE[:6]
    plans = []
    for unit in (1.0, 100.0):
        variogram = Variogram("matern32", 0.01 * unit**2, 8.0, unit**2)
        other = FieldMap(GRID)
        samples = as_samples(few, counts, [100.0 / unit] * 6)
        other.set_samples(samples, replace(FIT, variogram=variogram, mean_rate=4.0 * unit))
        other.update()
        model = explorer(strategy, [Property(other)], first)
        found = model.situation(RequestPlan(1, PlanKind.EXPLORE, (), 7200.0, 7200.0), (20.0, 10.0))
        plans.append((found.variance, found.map_variance, found.prospect().model.integrated_variance))
    np.testing.assert_allclose(plans[0][0], plans[1][0], rtol=1e-9)
    np.testing.assert_allclose(plans[0][1], plans[1][1], rtol=1e-9)
    assert plans[0][2] == pytest.approx(plans[1][2], rel=1e-9)


def test_the_fall_of_both_is_the_sum_of_the_falls():
    second = field_map(LATTICE[:5], rate=40.0, seed=2)
    both = explorer("greedy", [Property(second, 2.0)])
    look = both.situation(RequestPlan(1, PlanKind.EXPLORE, (), 7200.0, 7200.0), (20.0, 10.0)).prospect()
    first, second_model = look.model, look.model.others[0]
    nodes, seconds = first.stop_nodes[[3, 9]], np.array([50.0, 200.0])
    assert first.fall(nodes, seconds) > second_model.fall(nodes, seconds) > 0
    unit = variation(both.properties[0].field_map.soil_map.variogram, GRID.cells) / variation(
        second.soil_map.variogram, GRID.cells
    )
    cells = second.kriging.predict(GRID.cells)[1] - second.soil_map.variogram.nugget
    assert second_model.integrated_variance == pytest.approx(2.0 * unit * cells.mean(), rel=1e-6)


def test_the_variation_is_the_variance_of_fields_with_that_variogram():
    variogram = Variogram("exponential", 0.3, 15.0, 1.3)
    distance = np.linalg.norm(GRID.cells[:, None] - GRID.cells[None], axis=2)
    factor = np.linalg.cholesky(np.exp(-distance / 15.0) + 1e-9 * np.eye(len(distance)))
    fields = factor @ np.random.default_rng(0).normal(size=(len(distance), 4000))
    assert variation(variogram, GRID.cells) == pytest.approx(fields.var(axis=0).mean(), rel=0.03)
    # of a field with a trend only the ratio of sill and range is known: both grow, and hardly anything changes
    long, longer = (variation(Variogram("exponential", 0.0, r, r / 300), GRID.cells) for r in (3000.0, 6000.0))
    assert long == pytest.approx(longer, rel=0.01)
    assert variation(Variogram("matern32", 0.2, 10.0, 0.2), GRID.cells) == 0.0


# Names of further properties ------------------------------------------------------------------------------------


def test_names_with_and_without_weights():
    texts = ["compaction:0.5", "/salt", "r1/clay/", "/depth_2:0", "compaction:2"]
    assert property_weights(texts) == {"compaction": 2.0, "/salt": 1.0, "r1/clay": 1.0, "/depth_2": 0.0}
    assert property_weights([]) == {}


@pytest.mark.parametrize(
    "text", ["", "/", "a b", "2nd", "a//b", "a/2", "a-b", "a:", "a:much", "a:-1", "a:nan", "a:inf"]
)
def test_what_is_no_namespace_with_a_weight_is_refused(text):
    with pytest.raises(InputError, match="is not a namespace with a weight"):
        property_weights([text])


def test_the_name_of_a_field_makes_a_namespace():
    fields = ("synthetic-low", "fields/my clay.yaml", "fields/layer.2.yml", "2nd.yaml")
    assert [*map(property_name, fields)] == ["synthetic_low", "my_clay", "layer_2", "property_2nd"]
