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

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.lab.campaign import run_campaign
from soilmoist_ros.lab.campaign_data import CampaignData
from soilmoist_ros.lab.campaign_file import Campaign, missions
from soilmoist_ros.lab.computing import Failure
from soilmoist_ros.lab.figures import LOOKS, intervals_charts, strategies_charts
from soilmoist_ros.lab.mission_store import CampaignRun
from soilmoist_ros.lab.report import _differences, mean_sd_text, render_campaign_report, write_campaign_report
from soilmoist_ros.reporting.page.charts import Line
from soilmoist_ros.reporting.page.frame import dwell_text, strategy_text

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


def crafted(mission, mse=None, distance=None):
    """A stored mission whose error and distance are given as functions of its settings."""
    s = mission.settings
    time_s = np.arange(0.0, 3601, 300)
    error = np.full(13, 0.1 * (1 + 0.01 * s.seed) * (mse(s) if mse else 1.0))
    error[0] = np.nan
    driven = (distance(s) if distance else 500.0) + s.seed
    columns = {
        "time_s": time_s, "distance_m": driven * time_s / 3600, "samples": time_s // 300, "counting_s": time_s / 2,
        "mse": error, "mse_10s": 100 * error, "vwc_rmse": np.full(13, 0.02), "coverage95": np.full(13, 0.9),
    }  # fmt: skip
    return CampaignRun(mission.key, "v", f"The {s.field} field", "time is up", columns)


def data(campaign=CAMPAIGN, keep=lambda settings: True, **how):
    return CampaignData(campaign, [(m, crafted(m, **how)) for m in missions(campaign) if keep(m.settings)])


@pytest.mark.slow
def test_cases_are_told_apart():
    twice = CAMPAIGN.model_copy(
        update={
            "defaults": CAMPAIGN.defaults.model_copy(update={"preset": ("paper", "authors"), "cell_m": (1.0, 2.0)})
        }
    )
    titles = [case.title for case in data(twice).cases]
    assert len(set(titles)) == 8
    assert "The high field, preset authors, cell_m 2" in titles
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
    outcome = run_campaign(campaign, tmp_path, fake, workers=0)
    html = write_campaign_report(campaign, tmp_path, outcome.runs).read_text(encoding="utf-8")
    page = Page(html)
    for _, attributes in page.tags:
        for name in ("src", "href"):
            assert attributes.get(name, "data:image/").startswith("data:image/")
    assert not re.search(r"https?://|url\(|@import|<link|<script", html)
    charts = [attributes["id"] for tag, attributes in page.tags if tag == "figure"]
    intervals = [f"intervals-0-{number}" for number in range(3)]
    assert charts == ["strategies-0-distance_m", "strategies-0-mse", *intervals]
    assert all(len(one["aria-label"]) > 20 for _, one in page.tags if one.get("role") == "img")
    assert "SIMULATED DATA" in page.text
    assert "A <b>" in page.text
    assert "18 of 18 simulated missions" in page.text
    final = pd.read_csv(tmp_path / "missions.csv")
    rows = final[(final["strategy"] == "greedy") & (final["dwell"] == "ami:0.03")]
    assert mean_sd_text(rows["mse"]) in page.text
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


SEVEN = ("greedy", "monte_carlo", "adaptive_sampling", "random", "lattice", "two_pass", "gcb")


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


@pytest.mark.slow
def test_a_difference_is_clear_where_its_interval_leaves_out_zero():
    apart = data(mse=lambda s: 1 + (s.strategy == "greedy"))
    (one,) = [row for row in _differences(apart, apart.cases[1]) if row.first == strategy_text("greedy")]
    assert (one.error.clear, one.distance.clear) == (True, False)
    assert (one.error.share, one.distance.share) == ("+100 %", "+0 %")


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
