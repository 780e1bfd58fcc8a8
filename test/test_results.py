# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The scripts that measure: tables in docs/data/, and what the pages show of them."""

import importlib
import re
import sys
from itertools import product, starmap
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros import __version__
from soilmoist_ros.simulation import simulate_mission

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT / "docs" / "data"
PAGES = sorted((ROOT / "docs").glob("*.md"))
FILES = sorted(DATA.glob("*"))


@pytest.fixture(scope="module")
def script():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "scripts"))
        yield importlib.import_module


@pytest.fixture(scope="module")
def results(script):
    return script("results")


def test_a_table_is_read_as_it_was_written(results, tmp_path):
    facts = {"settings": "2 h: with a colon, and a comma", "command": "scripts/x --seeds 2", "date": "2026-11-23"}
    table = results.Table(["name", "error"], [["a|b", "1.02 ± 0.1"], ["# c", "-3"]], facts)
    results.write(table, tmp_path / "x.csv")
    assert results.read(tmp_path / "x.csv") == table
    assert results.markdown(table).splitlines() == [
        "| name |      error |",
        "| ---- | ---------: |",
        "| a\\|b | 1.02 ± 0.1 |",
        "| # c  |         -3 |",
        "",
        "2 h: with a colon, and a comma. `scripts/x --seeds 2`. 2026-11-23.",
    ]


def test_a_script_prints_what_it_saves(results, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(results, "FOLDER", tmp_path)
    monkeypatch.setattr(sys, "argv", ["scripts/bench_x.py", "--save", "--seeds", "2"])
    results.publish("x", ("what", "s"), [("a", 1)], "one thread", save=True)
    table = results.read(tmp_path / "x.csv")
    assert table.facts["command"] == ".venv/bin/python scripts/bench_x.py --seeds 2"
    assert table.facts["version"].startswith(f"soilmoist_ros {__version__}")
    assert capsys.readouterr().out.strip() == results.markdown(table)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_file_says_how_it_was_made_and_stands_on_a_page(path, results):
    table = results.read(path)
    assert {"command", "date"} <= set(table.facts) <= set(results.FACTS)
    assert all(len(row) == len(table.columns) for row in table.rows)
    made_by = re.search(r"scripts/\w+\.py", table.facts["command"])
    if made_by and "note" not in table.facts:  # its name is in the script
        source = (ROOT / made_by[0]).read_text()
        assert re.search(rf'publish\(\s*f?"{re.sub("_?[0-9a-z]+$", "", path.stem)}', source) or path.stem in source
    pages = "".join(page.read_text() for page in PAGES)
    assert re.search(rf"^<!-- made: data/{path.name}( [\w ]+)? -->$", pages, re.MULTILINE)


def test_pages_show_what_the_files_say(load_script, results, tmp_path, monkeypatch):
    docs = load_script("docs")
    behind = [page.name for page in PAGES if docs.filled(page.read_text()) != page.read_text()]
    assert behind == [], "run .venv/bin/python scripts/docs --tables"
    monkeypatch.setattr(results, "FOLDER", tmp_path / "data")
    (tmp_path / "data").mkdir()
    table = results.Table(["a", "b"], [["1", "2"], ["3", "4"]], {"settings": "one; " + "x" * results.CAPTION})
    results.write(table, tmp_path / "data" / "x.csv")
    shown = "|   b |\n| --: |\n|   4 |\n\nOne; …. [All 2 rows](data/x.csv)."
    assert results.excerpt("data/x.csv rows 2 columns 2") == shown


def test_the_comparison_is_with_the_pinned_program(results):
    crnpy = results.read(DATA / "programs_same.csv").columns[1]
    pinned = (ROOT / "requirements-test.txt").read_text()
    assert crnpy.replace(" ", "==") in pinned.splitlines(), "run scripts/compare_programs.py again"


@pytest.mark.slow
def test_a_lattice_of_the_benchmark_ends_as_any_mission(script):
    """Its maps are left out, apart from two: they decide nothing."""
    benchmark = script("bench_missions")
    job = benchmark.Job("rough", "lattice:fmi:60", 1, hours=0.4, cell_m=5.0)  # a quarter is an entry of the series
    last = benchmark.run(job)
    assert len({value for value in last["mse"] if value == value}) == 2
    whole = benchmark.outcome(simulate_mission(job.settings))
    for name in ("mse", "distance_m", "coverage95", "samples"):
        assert last[name][-1] == whole[name][-1]


# Defaults that may change a map are harmless on fields of others: a small fixed part -----------------------------


FIELDS = ("jacksboro-elevation", "rough")
MISSIONS = ("gcb", "lattice 60 s")
SEEDS = (1,)


@pytest.fixture(scope="module")
def zoo(script):
    return script("bench_zoo")


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
