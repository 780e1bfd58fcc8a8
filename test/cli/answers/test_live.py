# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
import time

from soilmoist_ros.cli.answers.live import json_lines
from soilmoist_ros.reporting.live_view import LiveMission


def test_a_line_of_json_for_each_change_once_a_second_at_most(capsys, monkeypatch):
    live = LiveMission(" patches ")
    with json_lines() as show:
        for now_s, rain in ((100.0, ""), (100.9, "likely"), (101.0, "likely"), (105.0, "likely")):
            monkeypatch.setattr(time, "monotonic", lambda now_s=now_s: now_s)
            live.rain = rain
            show(live)
    first, second = map(json.loads, capsys.readouterr().out.splitlines())
    assert (first["field"], first["rain"], second["rain"]) == ("patches", None, "likely")
    assert first["robots"][0]["x_m"] is None
    assert "time_utc" in second
