# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The soak of the cores: short days in which nothing may be lost, and what counts as growth."""

import json
from dataclasses import replace

import pytest


@pytest.fixture
def soak(load_script, monkeypatch):
    """The script ``scripts/soak`` as a module, with days of an hour."""
    module = load_script("soak")
    monkeypatch.setattr(module, "DAY_S", 3600.0)
    monkeypatch.setattr(module, "MAP_EACH", 100)
    return module


@pytest.mark.slow
def test_days_follow_each_other_lose_nothing_and_go_on_where_they_ended(soak, monkeypatch, tmp_path, capsys):
    arguments = ["soak", "--missions", "1", "--out", str(tmp_path)]
    for days in (1, 2):
        monkeypatch.setattr("sys.argv", [*arguments, "--days", str(days)])
        assert soak.main() == 0, capsys.readouterr().out
    entries = [json.loads(line) for line in (tmp_path / "soak.jsonl").read_text().splitlines()]
    assert [entry["day"] for entry in entries] == [0, 1]
    for entry in entries:
        assert entry["lost"] == entry["violations"] == 0
        assert 0.7 * 360 < entry["records"] < 360, "bad connections lose some records before they arrive"
        assert entry["bag_mb"] > 0 < entry["journal_mb"]
    assert not [path for path in tmp_path.iterdir() if path.is_dir()], "a day leaves nothing behind"


@pytest.mark.slow
def test_a_lost_record_is_a_fault(soak, monkeypatch, tmp_path):
    from soilmoist_ros.recording.map_sources import RecordLog

    kept = RecordLog.write
    written = []

    def forget(self, records):
        written.append(records)
        kept(self, [] if len(written) == 50 else records)

    monkeypatch.setattr(RecordLog, "write", forget)
    monkeypatch.setattr("sys.argv", ["soak", "--days", "1", "--missions", "0", "--out", str(tmp_path)])
    assert soak.main() == 1


@pytest.mark.parametrize(
    ("what", "each_day"), [("memory_mb", 1.0), ("handles", 1), ("threads", 1), ("update_s", 0.01), ("bag_mb", 0.5)]
)
def test_growth_is_a_fault_and_caches_that_fill_are_not(soak, what, each_day):
    day = soak.Day(
        day=0, memory_mb=200.0, handles=10, threads=2, update_s=0.05, records=8000, damaged=600, lost=0,
        bag_mb=3.0, journal_mb=2.0, visits=100, kills=3, violations=0, spent_s=60.0,
    )  # fmt: skip
    flat = [replace(day, memory_mb=200.0 - 80 * (number < 3)) for number in range(30)]
    assert soak.grown(flat) == []
    growing = [replace(one, **{what: getattr(day, what) + each_day * number}) for number, one in enumerate(flat)]
    (fault,) = soak.grown(growing)
    assert what in fault
