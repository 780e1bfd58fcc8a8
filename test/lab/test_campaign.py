# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Campaigns from file to tables: campaign.py, campaign_file.py, computing.py, table.py, mission_store.py."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from soilmoist_ros.foundation import InputError, resource, resource_names
from soilmoist_ros.lab import CampaignInterrupted, mission_store, run_campaign
from soilmoist_ros.lab.campaign_file import load_campaign, mission_key, missions
from soilmoist_ros.lab.mission_store import UnusableMissionError, pack, unpack
from soilmoist_ros.lab.table import METRICS
from soilmoist_ros.simulation import SETTINGS, MissionSettings, simulate_mission

HERE = Path(__file__).resolve().parents[1] / "simulation"
SMALL = """
title: Small
runs: 2
defaults: {hours: 1, preset: authors}
experiments:
  - {name: first, field: synthetic-high, strategy: [greedy, lattice], dwell: ["ami:0.03", "fmi:300"]}
  - {name: second, field: [synthetic-high, synthetic-low], strategy: greedy, dwell: "ami:0.03"}
"""


@pytest.fixture(scope="module")
def fake():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(HERE))
        import fake_mission

        yield fake_mission.simulate


@pytest.fixture(scope="module")
def whole(fake, tmp_path_factory):
    """Folder and outcome of the whole campaign, computed once."""
    path = tmp_path_factory.mktemp("whole")
    return path, run_campaign(written(path / "small.yaml", SMALL), path, fake, workers=0)


@pytest.fixture
def computed(whole, campaign, tmp_path):
    shutil.copytree(whole[0] / "runs", tmp_path / "runs")
    return campaign


@pytest.fixture
def campaign(tmp_path):
    return written(tmp_path / "small.yaml", SMALL)


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return load_campaign(str(path))


class Counted:
    """Counts the calls of a simulator; interrupts or fails at given calls."""

    def __init__(self, simulate, interrupt_at=None, fail=lambda settings: False):
        self.calls, self._simulate, self._interrupt_at, self._fail = [], simulate, interrupt_at, fail

    def __call__(self, settings):
        if self._interrupt_at == len(self.calls):
            raise KeyboardInterrupt
        self.calls.append(settings)
        if self._fail(settings):
            raise ValueError("the variogram\nhas no range")
        return self._simulate(settings)


def test_keys_are_stable_and_tell_settings_apart():
    assert mission_key(MissionSettings()) == mission_key(MissionSettings())
    assert mission_key(MissionSettings(seed=2)) != mission_key(MissionSettings())
    assert mission_key(MissionSettings(cell_m=1.0)) != mission_key(MissionSettings())
    explicit = MissionSettings(strategy="gcb", dwell="optimal", model="matern32", fit="reml", map_from="records")
    assert mission_key(explicit) == mission_key(MissionSettings()), "keys contain the values of a preset"


@pytest.mark.slow
def test_every_mistake_is_named(tmp_path):
    experiment = "{name: a b, strategy: [gredy, lattice], dwell: [ami:3, 600], seed: 4}"
    text = f"title: ''\nruns: 0\nexperiments: [{experiment}]\n"
    with pytest.raises(InputError) as caught:
        written(tmp_path / "c.yaml", text)
    named = {mistake.column for mistake in caught.value.mistakes}
    places = ("name", "seed", "strategy.0", "dwell.0", "dwell.1")
    assert {"title", "runs", *(f"experiments.0.{place}" for place in places)} <= named
    assert "did you mean 'greedy'" in str(caught.value)
    assert "did you mean 'ami:3%'" in str(caught.value)
    assert "tuple should have" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("experiments", "said"),
    [
        ("{name: a, field: example}", "truth"),
        ("{name: a, properties: [[gravel]]}", "no surrogate field or field file 'gravel'"),
        ("{name: a, graph: ./no.yaml, travel: graph}", "no.yaml: cannot be read"),
        ("{name: a, graph: ./bare.yaml, travel: [graph, free]}", "robot travels freely"),
        ("{name: a}, {name: a}", "two experiments are named 'a'"),
        ("{name: a, variogram: gaussian}", "unknown key 'variogram'"),
        ("{name: a, field: ./blind.yaml}", r"relief\.tif: there is no such file of covariates"),
    ],
)
def test_what_cannot_be_simulated_is_refused_before_the_first_mission(tmp_path, fake, experiments, said):
    (tmp_path / "bare.yaml").write_text("name: bare\n")
    ridge = resource("fields", "ridge").read_text(encoding="utf-8")
    (tmp_path / "blind.yaml").write_text(f"{ridge}\ncovariates: [{{file: relief.tif}}]\n", encoding="utf-8")
    counted = Counted(fake)
    text = f"title: t\nruns: 1\nexperiments: [{experiments}]\n"
    with pytest.raises(InputError, match=said):
        run_campaign(written(tmp_path / "c.yaml", text), tmp_path / "out", counted, workers=0)
    assert not counted.calls


@pytest.mark.slow
def test_tables(campaign, whole):
    folder, outcome = whole
    assert outcome.complete
    assert (outcome.computed, outcome.reused, outcome.remarks) == (10, 0, ())
    table = pd.read_csv(folder / "results.csv")
    assert list(table.columns) == ["key", *SETTINGS, "time_s", *METRICS]
    assert len(table) == 10 * 13
    mission, second = missions(campaign)[:2]
    assert (mission.settings.seed, second.settings.seed) == (1, 2)
    assert mission.settings == MissionSettings(hours=1.0, preset="authors", seed=1)
    one = mission_store.MissionStore(folder / "runs").read(mission)
    mine = table[table["key"] == mission.key].set_index("time_s")
    row = {name: column[one.columns["time_s"] == 1800][0] for name, column in one.columns.items()}
    names = ["distance_m", "samples", "mse"]
    assert mine.loc[1800, names].tolist() == pytest.approx([row[name] for name in names], rel=1e-6)
    assert mine.loc[1800, "counting_share"] == pytest.approx(row["counting_s"] / 1800)
    assert mine.loc[0, "samples"] == 0
    assert np.isnan(mine.loc[0, "mse"])
    final = pd.read_csv(folder / "missions.csv").set_index("key")
    assert final.loc[mission.key, "mse"] == pytest.approx(one.columns["mse"][-1], rel=1e-6)
    assert final.loc[mission.key, "mse_quarter"] == pytest.approx(mine.loc[900, "mse"], rel=1e-6)
    assert final.loc[mission.key, "experiments"] == "first second"


@pytest.mark.slow
def test_a_mission_survives_its_file(fake):
    result = fake(MissionSettings(seed=7, preset="paper"))
    content = pack(result, "k")
    stored = unpack(content)
    assert (stored.key, stored.field_title, stored.ended) == ("k", result.field_title, result.ended)
    for name in ("time_s", "distance_m", "samples", "mse", "counting_s"):
        expected = [0.0, *(getattr(row, name) for row in result.series)]
        np.testing.assert_array_equal(stored.columns[name][1:], expected[1:], name)
    assert content == pack(fake(result.settings), "k")


@pytest.mark.slow
def test_an_interrupted_campaign_resumes(campaign, tmp_path, fake):
    first = Counted(fake, interrupt_at=4)
    with pytest.raises(CampaignInterrupted, match=r"4 of 10 missions are stored.*again to resume"):
        run_campaign(campaign, tmp_path, first, workers=0)
    steps = []
    second = Counted(fake)
    outcome = run_campaign(campaign, tmp_path, second, workers=0, progress=lambda *step: steps.append(step))
    assert (outcome.reused, outcome.computed) == (4, 6)
    assert not set(first.calls) & set(second.calls)
    assert len(first.calls) + len(second.calls) == 10
    assert steps == [(done, 10) for done in range(4, 11)]
    third = Counted(fake)
    assert run_campaign(campaign, tmp_path, third, workers=0).reused == 10
    assert not third.calls


@pytest.mark.slow
def test_damaged_files_are_computed_again(computed, tmp_path, fake):
    keys = [mission.key for mission in missions(computed)]
    paths = [tmp_path / "runs" / f"{key}.npz" for key in keys]
    whole = paths[0].read_bytes()
    paths[0].write_bytes(whole[: len(whole) // 2])
    middle = bytearray(paths[1].read_bytes())
    middle[len(middle) // 3 : len(middle) // 2] = bytes(len(middle) // 2 - len(middle) // 3)
    paths[1].write_bytes(middle)
    paths[2].write_bytes(paths[3].read_bytes())
    paths[4].write_bytes(b"")
    again = Counted(fake)
    outcome = run_campaign(computed, tmp_path, again, workers=0)
    assert (outcome.computed, outcome.reused) == (4, 6)
    (remark,) = outcome.remarks
    assert remark.startswith(f"4 stored missions are computed again: {keys[0]}.npz cannot be read")
    with pytest.raises(UnusableMissionError, match="another mission"):
        mission_store.check(unpack(paths[3].read_bytes()), missions(computed)[2])
    assert paths[0].read_bytes() == whole


@pytest.mark.slow
def test_changed_settings_and_code_do_not_mix(computed, tmp_path, fake, monkeypatch):
    longer = written(tmp_path / "longer.yaml", SMALL.replace("hours: 1", "hours: 1.5"))
    changed = Counted(fake)
    assert run_campaign(longer, tmp_path, changed, workers=0).computed == 10
    assert set(pd.read_csv(tmp_path / "missions.csv")["hours"]) == {1.5}
    monkeypatch.setattr(mission_store, "code_version", lambda: "9.9")
    outcome = run_campaign(computed, tmp_path, changed, workers=0)
    assert outcome.computed == 10
    (remark,) = outcome.remarks
    assert re.match(
        r"10 stored missions are computed again: \w+\.npz was computed by version .*, this is 9\.9", remark
    )


@pytest.mark.slow
def test_a_failing_mission_does_not_end_the_campaign(campaign, tmp_path, fake):
    bad = Counted(fake, fail=lambda settings: settings.seed == 2 and settings.strategy == "lattice")
    outcome = run_campaign(campaign, tmp_path, bad, workers=0)
    assert not outcome.complete
    assert outcome.computed == 8
    assert len(outcome.failures) == 2
    text = str(outcome.failures[0])
    assert "strategy=lattice" in text
    assert "seed=2" in text
    assert "ValueError: the variogram has no range" in text
    assert "Traceback" in outcome.failures[0].details
    assert len(set(pd.read_csv(tmp_path / "results.csv")["key"])) == 8
    assert run_campaign(campaign, tmp_path, fake, workers=0).computed == 2


@pytest.mark.slow
def test_a_campaign_of_several_computers_is_joined_by_its_seeds(campaign, tmp_path, fake, whole):
    for seed in (1, 2):
        part = written(tmp_path / f"{seed}.yaml", SMALL.replace("runs: 2", f"runs: [{seed}]"))
        assert run_campaign(part, tmp_path / str(seed), fake, workers=0).computed == 5
        shutil.copytree(tmp_path / str(seed) / "runs", tmp_path / "runs", dirs_exist_ok=True)
    assert run_campaign(campaign, tmp_path, Counted(fake), workers=0).reused == 10
    assert stored(tmp_path) == stored(whole[0])


@pytest.mark.slow
def test_processes_do_not_change_the_results(campaign, tmp_path, fake, whole):
    assert run_campaign(campaign, tmp_path, fake, workers=2).complete
    assert stored(tmp_path) == stored(whole[0])


def stored(path):
    return {item.name: item.read_bytes() for item in sorted([*path.glob("runs/*.npz"), path / "results.csv"])}


@pytest.mark.slow
def test_a_process_that_dies_takes_only_its_mission_along(tmp_path, monkeypatch):
    (tmp_path / "deadly.py").write_text(
        "import os, fake_mission\n"
        "def simulate(settings):\n"
        "    assert os.environ['OPENBLAS_NUM_THREADS'] == '1'\n"
        "    if settings.seed == 2: os._exit(9)\n"
        "    return fake_mission.simulate(settings)\n"
    )
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.syspath_prepend(str(tmp_path))
    import deadly

    campaign = written(tmp_path / "c.yaml", "title: t\nruns: 4\nexperiments: [{name: a, hours: 1}]\n")
    outcome = run_campaign(campaign, tmp_path, deadly.simulate, workers=2)
    assert outcome.computed == 3
    assert [failure.mission.settings.seed for failure in outcome.failures] == [2]
    assert "died" in str(outcome.failures[0])


@pytest.mark.process
@pytest.mark.slow
def test_ctrl_c_stops_the_processes(tmp_path):
    (tmp_path / "slow.py").write_text(
        "import time, sys\n"
        "from pathlib import Path\n"
        "def simulate(settings):\n"
        "    Path(sys.argv[2], f'started{settings.seed}').touch()\n"
        "    while True:\n"
        "        time.sleep(0.02)\n"
        "if __name__ == '__main__':\n"
        "    import slow\n"
        "    from soilmoist_ros.lab import load_campaign, run_campaign\n"
        "    run_campaign(load_campaign(sys.argv[1]), Path(sys.argv[2]), slow.simulate, workers=1)\n"
    )
    path = tmp_path / "c.yaml"
    path.write_text("title: t\nruns: 3\nexperiments: [{name: a}]\n")
    command = [sys.executable, str(tmp_path / "slow.py"), str(path), str(tmp_path)]
    # Tests that a shell starts in the background ignore Ctrl-C; child processes inherit this.
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    deadline = time.monotonic() + 120
    while not list(tmp_path.glob("started*")) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert list(tmp_path.glob("started*"))
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert process.returncode != 0
    assert errors.strip().endswith("run the same command again to resume")
    assert errors.count("Traceback") == 1


@pytest.mark.slow
def test_what_is_missing_is_said_before_anything_is_computed(campaign, tmp_path, fake, monkeypatch):
    counted = Counted(fake)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        run_campaign(campaign, tmp_path / "file", counted, workers=0)
    with pytest.raises(InputError, match="cannot be -1"):
        run_campaign(campaign, tmp_path, counted, workers=-1)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(InputError, match=r"pip install 'soilmoist_ros\[campaign\]'"):
        run_campaign(campaign, tmp_path, counted, workers=0)
    assert not counted.calls


@pytest.mark.slow
def test_a_graph_counts_by_its_content_and_starts_at_the_campaign_file(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text("title: t\nruns: 1\nexperiments: [{name: a, travel: graph, graph: g.yaml}]\n")
    keys = set()
    for content in ("[]", "[1]"):
        (tmp_path / "g.yaml").write_text(content)
        (mission,) = missions(load_campaign(str(path)))
        assert mission.settings.graph == str(tmp_path / "g.yaml")
        keys.add(mission.key)
    assert len(keys) == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("[rough, 'smooth:0.5']", ["rough smooth:0.5"]),
        ("[[rough], ['smooth:0.5', patches], []]", ["rough", "smooth:0.5 patches", ""]),
        ("[]", [""]),
    ],
)
def test_properties_are_a_list_and_lists_make_a_grid(tmp_path, given, expected):
    text = f"title: t\nruns: 1\nexperiments: [{{name: a, properties: {given}}}]\n"
    found = missions(written(tmp_path / "c.yaml", text))
    assert [" ".join(map(str, mission.settings.properties)) for mission in found] == expected


@pytest.mark.slow
def test_each_further_property_has_its_columns_in_the_tables(tmp_path):
    experiment = "{name: a, hours: 0.05, properties: [[], ['rough:0', smooth]]}"
    text = f"title: t\nruns: 1\nexperiments: [{experiment}]\n"
    run_campaign(written(tmp_path / "c.yaml", text), tmp_path, simulate_mission, workers=0)
    final = pd.read_csv(tmp_path / "missions.csv").set_index("properties")
    assert list(final.index) == ["none", "rough:0 smooth"]
    assert {"mse_rough", "coverage95_rough", "mse_smooth", "coverage95_smooth"} < set(final.columns)
    assert final.loc["none", ["mse_rough", "mse_smooth"]].isna().all()


@pytest.mark.parametrize("name", resource_names("campaigns"))
@pytest.mark.slow
def test_every_shipped_campaign_has_missions(name):
    assert len(missions(load_campaign(name))) > 1
