# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Campaigns of simulated missions for research: file, workers, store, tables and report; only the command uses it."""

from typing import TYPE_CHECKING

from soilmoist_ros.foundation import open_door

if TYPE_CHECKING:
    from soilmoist_ros.lab.campaign import RUNS as RUNS
    from soilmoist_ros.lab.campaign import CampaignInterrupted as CampaignInterrupted
    from soilmoist_ros.lab.campaign import run_campaign as run_campaign
    from soilmoist_ros.lab.campaign import stored_rows as stored_rows
    from soilmoist_ros.lab.campaign_data import CampaignData as CampaignData
    from soilmoist_ros.lab.campaign_file import Campaign as Campaign
    from soilmoist_ros.lab.campaign_file import FindingKey as FindingKey
    from soilmoist_ros.lab.campaign_file import Mission as Mission
    from soilmoist_ros.lab.campaign_file import load_campaign as load_campaign
    from soilmoist_ros.lab.campaign_file import missions as missions
    from soilmoist_ros.lab.comparisons import LATTICES as LATTICES
    from soilmoist_ros.lab.comparisons import PairedDifference as PairedDifference
    from soilmoist_ros.lab.comparisons import hindsight_table as hindsight_table
    from soilmoist_ros.lab.comparisons import paired_differences as paired_differences
    from soilmoist_ros.lab.computing import Failure as Failure
    from soilmoist_ros.lab.figures import campaign_figures as campaign_figures
    from soilmoist_ros.lab.mission_store import MissionStore as MissionStore
    from soilmoist_ros.lab.mission_store import StoredMission as StoredMission
    from soilmoist_ros.lab.mission_store import code_version as code_version
    from soilmoist_ros.lab.progress import CampaignProgress as CampaignProgress
    from soilmoist_ros.lab.progress import Progress as Progress
    from soilmoist_ros.lab.report import write_campaign_report as write_campaign_report
    from soilmoist_ros.lab.table import CASE as CASE
    from soilmoist_ros.lab.table import Finished as Finished
    from soilmoist_ros.lab.table import missions_table as missions_table
    from soilmoist_ros.lab.table import results_table as results_table

__getattr__, __dir__, __all__ = open_door(
    __name__,
    {
        "campaign": "CampaignInterrupted RUNS run_campaign stored_rows",
        "campaign_data": "CampaignData",
        "campaign_file": "Campaign FindingKey Mission load_campaign missions",
        "comparisons": "LATTICES PairedDifference hindsight_table paired_differences",
        "computing": "Failure",
        "figures": "campaign_figures",
        "mission_store": "MissionStore StoredMission code_version",
        "progress": "CampaignProgress Progress",
        "report": "write_campaign_report",
        "table": "CASE Finished missions_table results_table",
    },
)
