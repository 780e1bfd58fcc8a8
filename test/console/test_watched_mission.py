# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page of a simulated mission (watched_mission.py) and the moments that it shows."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import urllib.error
import urllib.request

import numpy as np
import pytest

pytest.importorskip("aiohttp")
from soilmoist_ros.console.watched_mission import WatchedMission
from soilmoist_ros.simulation import MissionSettings, simulate_mission
from soilmoist_ros.simulation.fields.catalogue import surrogate_field

SETTINGS = MissionSettings("half-wet", hours=0.25, seed=3, cell_m=2.0, dwell="fmi:20", strategy="gcb")
HASTE = 1e7
"""Time factor at which nobody waits."""


def watched(tmp_path, settings=SETTINGS, robots=("",)):
    field = surrogate_field(settings.field).field
    return WatchedMission(field, field.grid(settings.cell_m), robots, HASTE, tmp_path, "A simulated mission.")


def fetched(page, path):
    with urllib.request.urlopen(page.address + path, timeout=10) as reply:
        return reply.read()


@pytest.mark.slow
def test_the_page_shows_the_map_the_robot_and_its_visits_and_does_not_change_the_mission(tmp_path):
    with watched(tmp_path) as page:
        result = simulate_mission(SETTINGS, watch=page.show)
        shown = page._board.snapshot()
        assert b"survey.js" in fetched(page, "")
        assert fetched(page, "map/vwc.png").startswith(b"\x89PNG")
        values = json.loads(fetched(page, "at?x=50&y=25"))["values"]
    row, column = result.soil_map.grid.shape[0] // 2, round(50 / 2.0)
    assert values["rate"] == pytest.approx(result.soil_map.rate[row, column], rel=0.05), "the last map"
    assert (shown["mission/"]["phase"], shown["watch_only"]) == ("finished", "A simulated mission.")
    assert list(shown["visits"]) == [[round(visit.x_m, 2), round(visit.y_m, 2)] for visit in result.visits]
    assert len(shown["trail/"]) > 5
    alone = simulate_mission(SETTINGS)
    assert result.visits == alone.visits
    np.testing.assert_array_equal(result.soil_map.rate, alone.soil_map.rate)


def test_nobody_steers(tmp_path):
    with watched(tmp_path) as page:
        for path in ("command", "stop", "take"):
            request = urllib.request.Request(
                page.address + path, b'{"verb": "abort"}', {"Content-Type": "application/json"}
            )
            with pytest.raises(urllib.error.HTTPError, match="403") as refused:
                urllib.request.urlopen(request, timeout=10)
            refused.value.close()


def test_a_stop_ends_the_mission_and_keeps_what_was_counted(tmp_path):
    with watched(tmp_path) as page:

        def show(moment):
            if moment.time_s > 400:
                page.stop()
            return page.show(moment)

        result = simulate_mission(SETTINGS, watch=show)
    assert 400 < result.series[-1].time_s < 450
    assert "operator" in result.ended
    assert result.soil_map is not None


def test_a_signal_may_stop_it_at_any_line_of_a_wait(tmp_path):
    def every_line(frame, event, argument):
        page.stop()
        return every_line

    def wait():
        sys.settrace(every_line)
        page.wait(0.01)
        sys.settrace(None)

    with watched(tmp_path) as page:
        waiting = threading.Thread(target=wait, daemon=True)
        waiting.start()
        waiting.join(20)
        assert not waiting.is_alive(), "the handler waits for a lock of the thread that it interrupts"
        assert page.stopped


@pytest.mark.process
def test_ctrl_c_ends_a_live_mission_with_results(tmp_path):
    out = tmp_path / "run"
    options = ["--field", "half-wet", "--cell", "3", "--hours", "1", "--live", "--time-factor", "120"]
    command = [sys.executable, "-m", "soilmoist_ros.cli.main", "simulate", *options, "--out", str(out)]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert run.stdout.readline().startswith("page       http://127.0.0.1:")
        for line in run.stderr:
            if "10 %" in line:
                run.send_signal(signal.SIGINT)
                break
        said, errors = run.communicate(timeout=120)
    finally:
        run.kill()
    assert run.returncode == 130, errors
    assert "the results are those of the mission until then" in errors
    assert "open       file://" in said
    assert json.loads((out / "summary.json").read_text())["mission"]["final"]["time_s"] < 3600
