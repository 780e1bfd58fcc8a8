# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Run campaigns: simulate missions in parallel, store each, and collect them in tables."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from soilmoist_ros.foundation import InputError, cores, optional_module
from soilmoist_ros.lab.campaign_file import Campaign, CampaignMission, missions
from soilmoist_ros.lab.computing import Failure, Simulate, in_processes, in_this_process
from soilmoist_ros.lab.mission_store import CampaignRun, MissionStore, UnusableMissionError
from soilmoist_ros.lab.table import write_tables
from soilmoist_ros.mapping import require_covariates
from soilmoist_ros.simulation import surrogate_field

RUNS = "runs"
"""Folder of the finished missions inside the output folder."""


@dataclass(frozen=True)
class CampaignOutcome:
    """Result of a campaign."""

    computed: int  # missions computed now
    reused: int  # stored missions that were reused
    failures: tuple[Failure, ...]  # in the order of the campaign; the tables contain all other missions
    remarks: tuple[str, ...]  # notes for the user, such as damaged files whose missions were computed again
    written: tuple[Path, ...]  # paths of the tables
    runs: tuple[tuple[CampaignMission, CampaignRun], ...]  # finished missions, in the order of the campaign

    @property
    def complete(self) -> bool:
        """True if every mission finished."""
        return not self.failures


class CampaignInterrupted(KeyboardInterrupt):
    """The user interrupted the campaign; the message states the progress and how to resume."""


def run_campaign(
    campaign: Campaign,
    out: Path,
    simulate: Simulate,
    workers: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> CampaignOutcome:
    """Compute all missions of a campaign that are not stored yet, and write the tables.

    A mission depends on its settings alone: the number of processes and interruptions do not change the results.
    Each finished mission is stored at once in ``out/runs``. Stored missions are reused if they are complete and
    come from the current version of the code. Missions are computed seed by seed, so an unfinished campaign has
    about as many runs of each combination.

    :param simulate: simulates one mission; local processes need an importable function
    :param workers: local processes; one per core if ``None``, 0 computes in this process
    :param progress: called at the start and after each mission with the missions done, failed and reused ones
        too, and all
    :raises InputError: if the folder cannot be written, or another campaign writes in it
    :raises CampaignInterrupted: on Ctrl-C; the running missions are ended
    """
    if workers is not None and workers < 0:
        raise InputError(f"the number of processes cannot be {workers}", "give 0 or more")
    optional_module("pandas")
    wanted = missions(campaign)
    every = [mission.settings for mission in wanted]
    names = (name for one in every for name in (one.field_name, *(its.field_name for its in one.properties)))
    fields = map(surrogate_field, dict.fromkeys(names))
    require_covariates(source for field in fields for source in field.field.covariates)
    for settings in {str(replace(one, seed=0)): one for one in every}.values():
        settings.check()
    store = MissionStore(out / RUNS)
    with store.alone():
        runs, remarks = _already_done(wanted, store)
        reused = len(runs)
        todo = sorted(
            (mission for mission in wanted if mission.key not in runs),
            key=lambda mission: campaign.runs.index(mission.settings.seed),
        )
        failures: dict[str, Failure] = {}
        progress(reused, len(wanted))
        count = cores() if workers is None else workers
        flow = in_processes(todo, simulate, count) if count else in_this_process(todo, simulate)
        with closing(flow) as computed:
            try:
                for mission, content in computed:
                    if isinstance(content, bytes):
                        try:
                            runs[mission.key] = store.write(mission, content)
                        except UnusableMissionError as error:
                            content = Failure(mission, f"its result {error}")
                    if isinstance(content, Failure):
                        failures[mission.key] = content
                    progress(len(runs) + len(failures), len(wanted))
            except KeyboardInterrupt:
                computed.close()
                raise CampaignInterrupted(
                    f"stopped: {len(runs)} of {len(wanted)} missions are stored in {store.folder}; run the same "
                    "command again to resume"
                ) from None
        in_order = tuple((mission, runs[mission.key]) for mission in wanted if mission.key in runs)
        return CampaignOutcome(
            computed=len(runs) - reused, reused=reused,
            failures=tuple(failures[m.key] for m in wanted if m.key in failures), remarks=tuple(remarks),
            written=tuple(write_tables(out, in_order, campaign.table_every_s)), runs=in_order,
        )  # fmt: skip


def _already_done(wanted: list[CampaignMission], store: MissionStore) -> tuple[dict[str, CampaignRun], list[str]]:
    """Finished missions by key, and remarks on files that cannot be used."""
    runs: dict[str, CampaignRun] = {}
    unusable: list[str] = []
    for mission in wanted:
        try:
            if (stored := store.read(mission)) is not None:
                runs[mission.key] = stored
        except UnusableMissionError as error:
            unusable.append(str(error))
    return runs, [f"{len(unusable)} stored missions are computed again: {one}" for one in unusable[:1]]
