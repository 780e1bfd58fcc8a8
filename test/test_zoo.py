# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Defaults that may change a map are harmless on fields that the project did not make: a small fixed part."""

import importlib
from itertools import product, starmap
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
FIELDS = ("jacksboro-elevation", "rough")
MISSIONS = ("gcb", "lattice 60 s")
SEEDS = (1,)


@pytest.fixture(scope="module")
def zoo():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "scripts"))
        yield importlib.import_module("bench_zoo")


@pytest.fixture(scope="module")
def missions(zoo):
    return {}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["drift", "anisotropy"])
def test_a_default_is_harmless_where_it_does_not_apply(zoo, missions, name):
    comparison = zoo.COMPARISONS[name]
    arms = [zoo.arm(settings) for settings in (comparison.on, comparison.off)]
    for job in starmap(zoo.Job, product(FIELDS, MISSIONS, SEEDS, arms)):
        if job.key not in missions:
            missions[job.key] = job.row()
    found = zoo.Score.of(comparison, missions)
    assert len(found.on) == len(FIELDS) * len(MISSIONS) * len(SEEDS)
    assert np.mean(list(found.ratios.values())) <= 1.03
    assert found.worst <= zoo.WORST
    assert 0.85 <= found.coverage.mean() <= 0.995


def test_any_surface_becomes_a_field_by_one_rule(zoo):
    """The values are a plane whose units do not matter; a gap is interpolated."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(1e6, 3e6, 101), np.linspace(-2.0, 0.0, 81)))
    kept = ~((np.abs(x - 2e6) < 1e5) & (np.abs(y + 1.0) < 0.1))
    field = zoo.surface_rate(np.column_stack([x, y])[kept], -7.0 * (x / 1e6)[kept], (60, 50))
    places = np.array([[0.0, 0.0], [30.0, 25.0], [60.0, 50.0], [15.0, 40.0]])
    assert field(places) == pytest.approx([5.5, 4.0, 2.5, 4.75], abs=0.05)
    assert (field.values.min(), field.values.max()) == (2.5, 5.5)


def test_the_mean_of_a_square_metre_is_its_value(zoo):
    xy = np.array([[0.0, 0.0], [0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]])
    rate = zoo.surface_rate(xy, np.array([1.0, 3.0, 1.0, 4.0, np.nan]), (2, 2))
    assert rate(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]])) == pytest.approx([3.5, 2.5, 5.5])
