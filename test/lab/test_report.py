# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page of a campaign: report.py with campaign_data.py, and figures.py."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.lab.campaign import Failure, missions, run_campaign
from soilmoist_ros.lab.campaign_data import CampaignData
from soilmoist_ros.lab.campaign_file import Campaign
from soilmoist_ros.lab.figures import LOOKS, intervals_charts, strategies_charts
from soilmoist_ros.lab.mission_store import CampaignRun
from soilmoist_ros.lab.report import mean_sd_text, render_campaign_report, write_campaign_report
from soilmoist_ros.lab.table import mission_row
from soilmoist_ros.reporting.page.charts import Line
from soilmoist_ros.reporting.page.frame import dwell_text, strategy_text
from soilmoist_ros.simulation.mission.mission_result import MapErrors, SeriesRow

FAKE = Path(__file__).resolve().parents[1] / "simulation"
CAMPAIGN = Campaign.model_validate(
    {
        "title": "A <small> campaign",
        "description": "Fixed against adaptive.",
        "runs": 4,
        "defaults": {"hours": 1, "dwell": "ami:0.03"},
        "experiments": [
            {
                "name": "intervals",
                "field": ["high", "low"],
                "strategy": ["greedy", "monte_carlo"],
                "dwell": ["fmi:600", "fmi:300", "ami:0.025", "ami:0.03"],
            },
            {"name": "strategies", "field": "high", "strategy": ["greedy", "monte_carlo", "adaptive_sampling"]},
        ],
    }
)
NOTHING = np.empty((0, 0))


def crafted(mission, mse=None, distance=None, border=None):
    """A stored mission whose error, distance and stops are given as functions of its settings."""
    s = mission.settings
    error = 0.1 * (1 + 0.01 * s.seed) * (mse(s) if mse else 1.0)
    driven = (distance(s) if distance else 500.0) + s.seed
    series = tuple(
        SeriesRow(t, driven * t / 3600, int(t // 300), t / 2, (MapErrors(error if t else np.nan, 0.02, 0.9),))
        for t in np.arange(0.0, 3601, 300)
    )
    axis = np.arange(0.5, 20)
    inner, outer = (10.0, 10.0), (1.0, 1.0)
    outside = round(20 * (border(s) if border else 0.5)) + s.seed % 2
    places = [outer] * outside + [inner] * (20 - outside)
    return CampaignRun(
        settings=s, key=mission.key, version="v", field_title=f"The {s.field} field", ended="time is up",
        efficiency=0.7, series=series, visits=tuple(Visit("P", x, y, 0.0, 100.0, 300, "") for x, y in places),
        tracks=(np.array([(0.0, 0.0), (5.0, 5.0)]),), x_m=axis, y_m=axis, rate=np.ones((20, 20)),
        rate_sd=np.ones((20, 20)), truth_rate=np.ones((20, 20)),
        outlines=(np.array([(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0)]),),
    )  # fmt: skip


def data(campaign=CAMPAIGN, keep=lambda settings: True, **how):
    stored = {m.key: crafted(m, **how) for m in missions(campaign) if keep(m.settings)}
    rows = [(m, mission_row(stored[m.key], 300.0)) for m in missions(campaign) if m.key in stored]
    return CampaignData(campaign, rows)


@pytest.mark.slow
def test_cases_are_told_apart():
    twice = CAMPAIGN.model_copy(
        update={
            "defaults": CAMPAIGN.defaults.model_copy(update={"preset": ("paper", "authors"), "cell_m": (1.0, 2.0)})
        }
    )
    titles = [case.title for case in data(twice).cases]
    assert len(set(titles)) == 8
    assert "The high field, constants: authors, cells of 2 m" in titles
    assert data().main_dwell(data().cases[0]) == "ami:0.03"


class Page(HTMLParser):
    """Tags with attributes, and the visible text."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.text, self._style = [], "", False
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self._style = tag in ("style", "script")

    def handle_endtag(self, tag):
        self._style = False

    def handle_data(self, text):
        if not self._style:
            self.text += text


@pytest.fixture
def fake(monkeypatch):
    monkeypatch.syspath_prepend(str(FAKE))
    import fake_mission

    return fake_mission.simulate


@pytest.mark.slow
def test_page_of_a_campaign(tmp_path, fake):
    experiments = [{"name": "a", "field": "synthetic-high", "strategy": ["greedy", "adaptive_sampling", "lattice"],
                    "dwell": ["fmi:300", "ami:0.03"]}]  # fmt: skip
    campaign = Campaign.model_validate({"title": "A <b>", "runs": 3, "experiments": experiments})
    run_campaign(campaign, tmp_path, fake, workers=0)
    html = write_campaign_report(campaign, tmp_path).read_text(encoding="utf-8")
    page = Page(html)
    for _, attributes in page.tags:
        for name in ("src", "href"):
            assert attributes.get(name, "data:image/").startswith("data:image/")
    assert not re.search(r"https?://|url\(|@import|<link|<script", html)
    charts = [attributes["id"] for tag, attributes in page.tags if tag == "figure"]
    intervals = [f"intervals-0-{number}" for number in range(3)]
    assert charts == ["strategies-0-distance_m", "strategies-0-mse", *intervals, "coverage-0"]
    assert all(len(one["aria-label"]) > 20 for _, one in page.tags if one.get("role") == "img")
    assert "SIMULATED DATA" in page.text
    assert "A <b>" in page.text
    assert "18 of 18 simulated missions" in page.text
    final = pd.read_parquet(tmp_path / "missions.parquet")
    rows = final[(final["strategy"] == "greedy") & (final["dwell"] == "ami:0.03")]
    assert mean_sd_text(rows["mse"]) in page.text
    assert mean_sd_text(100 * rows["mse"]) in page.text
    assert mean_sd_text(rows["distance_m"]) in page.text
    assert "nan" not in page.text.lower()
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


@pytest.mark.slow
def test_missing_and_failed_missions_are_named():
    some = data(keep=lambda s: s.seed != 3)
    text = Page(render_campaign_report(some)).text
    assert "17 of 68 missions are missing" in text
    assert "Run the campaign again" in text
    failure = Failure(missions(CAMPAIGN)[2], "ValueError: <no range>")
    text = Page(render_campaign_report(some, [failure] * 12)).text
    assert "seed=3: ValueError: <no range>" in text
    assert "and 2 more" in text
    with pytest.raises(InputError, match="no mission of the campaign is finished"):
        render_campaign_report(data(keep=lambda s: False))


SEVEN = ("greedy", "monte_carlo", "adaptive_sampling", "random", "lattice", "ivr", "gcb")


@pytest.mark.slow
def test_lines_are_told_apart_and_show_the_means_over_the_runs():
    """Seven strategies and four dwell rules; one rule has no number."""
    dwells = ("ami:0.03", "fmi:600", "fmi:300", "optimal")
    experiment = CAMPAIGN.experiments[0].model_copy(update={"strategy": SEVEN, "dwell": dwells})
    campaign = CAMPAIGN.model_copy(update={"experiments": (experiment,)})
    wide = data(campaign, mse=lambda s: 1 + SEVEN.index(s.strategy) + 0.3 * dwells.index(s.dwell))
    case = wide.cases[0]
    _, error = strategies_charts(wide, case)
    lines = [mark for mark in error.marks if isinstance(mark, Line)]
    assert [mark.name for mark in lines] == [strategy_text(name) for name in SEVEN]
    assert [(mark.colour, mark.dashed) for mark in lines] == list(LOOKS[:7])
    runs = [0.1 * (1 + 0.01 * seed) for seed in range(1, 5)]
    assert 10 ** lines[2].y[-1] == pytest.approx(3 * np.mean(runs))
    assert "0.2" in [tick.text for tick in error.up]
    names = [name for _, name in next(intervals_charts(wide, case)).names]
    assert names == ["FMI 600 s", "FMI 300 s", "AMI 3 %", "Optimal"]


def test_texts():
    assert dwell_text("ami:0.025") == "AMI 2.5 %"
    assert (dwell_text("optimal"), strategy_text("new_idea")) == ("Optimal", "new idea")
    assert mean_sd_text(pd.Series([1.0, 2.0, np.nan])) == "1.50 ± 0.71"
    assert mean_sd_text(pd.Series([380.0, 460.0])) == "420 ± 57"
    assert mean_sd_text(pd.Series([np.nan])) == "–"


@pytest.mark.slow
def test_the_best_lattice_in_hindsight_is_named_and_all_others_are_compared_with_it():
    listed = {
        "title": "Hindsight",
        "runs": 3,
        "experiments": [{"name": "all", "field": ["high", "low"], "strategy": "gcb", "dwell": "optimal"}],
    }
    plain = Campaign.model_validate(listed)
    listed["experiments"][0] |= {"hindsight": True, "field": "high"}
    error = {"fmi:10": 0.5, "fmi:20": 0.4, "fmi:30": 0.7, "fmi:60": 0.9, "optimal": 0.3}
    there = data(Campaign.model_validate(listed), mse=lambda s: error[s.dwell], distance=lambda s: 100.0)
    page = render_campaign_report(there)
    assert "best lattice in hindsight: FMI 20 s" in page
    assert re.search(r"0\.75 ± 0\.00</td><td class=\"n\">1\.00<", page)
    assert "best lattice" not in render_campaign_report(data(plain))
