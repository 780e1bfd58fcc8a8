# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Campaigns of simulated missions for research: file, workers, store, tables and report; only the command uses it."""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    # fmt: off
    from soilmoist_ros.lab.campaign import RUNS as RUNS, CampaignInterrupted as CampaignInterrupted, run_campaign as run_campaign
    from soilmoist_ros.lab.campaign_file import Campaign as Campaign, load_campaign as load_campaign, missions as missions
    from soilmoist_ros.lab.report import write_campaign_report as write_campaign_report
    # fmt: on

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "campaign": "CampaignInterrupted RUNS run_campaign",
        "campaign_file": "Campaign load_campaign missions",
        "report": "write_campaign_report",
    },
)
