"""Rehearsals: ``rehearsal.py``, ``planner.py``, ``world.py``, ``cases.py``, ``clients.py``, ``faults.py``."""

import importlib.machinery
import importlib.util
from dataclasses import replace
from pathlib import Path

import pytest

from soilmoist_ros.simulation.rehearsal.cases import make_case
from soilmoist_ros.simulation.rehearsal.faults import Fault, Faults, Span
from soilmoist_ros.simulation.rehearsal.rehearsal import rehearse
from soilmoist_ros.simulation.rehearsal.world import NAVIGATORS

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def safety():
    """The script ``scripts/safety`` as a module."""
    loader = importlib.machinery.SourceFileLoader("safety", str(ROOT / "scripts/safety"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("safety", loader))
    loader.exec_module(module)
    return module


@pytest.fixture
def rehearsed(safety, tmp_path):
    """A function that rehearses a case, each time with a new journal."""
    stores = iter(range(100))

    def run(case):
        return rehearse(case, safety.Disk(tmp_path / str(next(stores))))

    return run


def quiet(number, **changes):
    """A case without faults."""
    return replace(make_case(7, number), faults=Faults(), **{"budget_s": 600.0, **changes})


@pytest.mark.parametrize("turn", range(3), ids=NAVIGATORS)
def test_a_mission_without_faults_measures_and_ends(rehearsed, turn):
    outcome = rehearsed(quiet(30 + turn, strategy="greedy"))
    assert outcome.visits >= 3
    assert outcome.driven_m > 20
    assert outcome.ended.startswith("finished")
    assert not outcome.refused


def test_case_and_outcome_follow_from_seed_and_number(rehearsed):
    case = replace(make_case(7, 4), budget_s=300.0)
    assert str(case) == str(make_case(7, 4))
    assert str(case) != str(make_case(8, 4))
    assert rehearsed(case) == rehearsed(case)


def test_a_killed_planner_comes_back_with_its_mission(rehearsed):
    kill = Faults([Span(Fault.KILL_PLANNER, 200.0, 1.0, 0.0)])
    outcome = rehearsed(replace(quiet(31, strategy="greedy"), faults=kill))
    assert outcome.kills == 1
    assert outcome.visits >= 3
    assert outcome.ended.startswith("finished")
