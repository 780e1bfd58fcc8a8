# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The results of a campaign, prepared for charts and tables."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from soilmoist_ros.exploration import STRATEGIES
from soilmoist_ros.lab.campaign_file import Campaign, missions
from soilmoist_ros.lab.comparisons import hindsight_table, paired_differences
from soilmoist_ros.lab.mission_store import Stored
from soilmoist_ros.lab.table import CASE, missions_table, results_table
from soilmoist_ros.reporting import plain

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Case:
    """Missions on one field that differ in strategy, dwell and seed only."""

    number: int  # position in the campaign
    field: str  # field, as in the settings
    title: str  # display name; includes the settings that distinguish cases of one field
    hours: float  # mission time [h]


class CampaignData:
    """All finished missions of a campaign."""

    def __init__(self, campaign: Campaign, stored: Stored) -> None:
        self.campaign = campaign
        planned = missions(campaign)
        self.expected = len(planned)
        self._dwells = list(dict.fromkeys(mission.settings.dwell for mission in planned))
        self.missions = missions_table(stored)
        self.results = results_table(stored, campaign.table_every_s)
        number = self.missions.groupby(list(CASE), sort=False, dropna=False).ngroup()
        by_key = dict(zip(self.missions["key"], number.astype(int).tolist(), strict=True))
        self.missions["case"] = self.missions["key"].map(by_key)
        self.results["case"] = self.results["key"].map(by_key)

    @cached_property
    def cases(self) -> list[Case]:
        """The cases in the order of the campaign."""
        first = self.missions.drop_duplicates("case")
        found = []
        for row in first.to_dict("records"):
            siblings = first[first["field"] == row["field"]]
            differing = [name for name in CASE if siblings[name].nunique(dropna=False) > 1]
            given = [name for name in differing if row[name] == row[name]]  # defaults are NaN, and need no words
            extra = [f"{name} {plain(row[name])}" for name in given]
            namesakes = first[first["field_title"] == row["field_title"]]["field"].nunique() > 1
            name = f"{row['field_title']} ({row['field']})" if namesakes else str(row["field_title"])
            found.append(Case(int(row["case"]), str(row["field"]), ", ".join([name, *extra]), float(row["hours"])))
        return found

    @cached_property
    def hindsight(self) -> pd.DataFrame:
        """Combinations against the best lattice in hindsight, by the number of the case."""
        return hindsight_table(self.missions, ["case"])

    def differences(self, case: Case) -> list[dict[str, Any]]:
        """Differences of the strategies with the main dwell rule, or of all combinations of a single strategy."""
        rows = self.final(case) if case in self.strategy_cases else self._of(self.missions, case)
        return list(paired_differences(rows))

    @cached_property
    def strategy_cases(self) -> list[Case]:
        """Cases in which strategies can be compared."""
        return [case for case in self.cases if self.final(case)["strategy"].nunique() > 1]

    def main_dwell(self, case: Case) -> str:
        """The dwell rule with the most strategies, then the most missions, then the first."""
        rows = self._of(self.missions, case)
        dwells = sorted(rows["dwell"].unique(), key=self._dwells.index)

        def size(dwell: str) -> tuple[int, int]:
            some = rows[rows["dwell"] == dwell]
            return some["strategy"].nunique(), len(some)

        return str(max(dwells, key=size))

    def final(self, case: Case) -> pd.DataFrame:
        """One row per mission of a case, with the main dwell rule only."""
        rows = self._of(self.missions, case)
        return rows[rows["dwell"] == self.main_dwell(case)]

    def over_time(self, case: Case, dwell: str | None = None) -> pd.DataFrame:
        """Rows of a case, of one dwell rule or all."""
        rows = self._of(self.results, case)
        return rows if dwell is None else rows[rows["dwell"] == dwell]

    def groups(self, case: Case) -> list[tuple[str, str, pd.DataFrame]]:
        """Strategy, dwell and final values of each combination of a case, in display order."""
        rows = self._of(self.missions, case)
        found = [
            (str(key[0]), str(key[1]), group) for key, group in rows.groupby(["strategy", "dwell"], sort=False)
        ]
        return sorted(found, key=lambda group: strategy_order(group[0]))

    def _of(self, table: pd.DataFrame, case: Case) -> pd.DataFrame:
        return table[table["case"] == case.number]


def strategies_in(rows: pd.DataFrame) -> list[str]:
    """Strategies that occur, in display order."""
    return sorted(rows["strategy"].unique(), key=strategy_order)


def strategy_order(strategy: str) -> int:
    """Position of a strategy in lists and legends."""
    known = STRATEGIES.names()
    return known.index(strategy) if strategy in known else len(known)
