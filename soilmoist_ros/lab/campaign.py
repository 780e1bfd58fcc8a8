# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Run campaigns: simulate missions in parallel, store each, and collect them in tables."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from soilmoist_ros.foundation import InputError, SoilmoistError, cores, duration, optional_module
from soilmoist_ros.lab.campaign_file import Campaign, CampaignMission, missions
from soilmoist_ros.lab.computing import Failure, Flow, Simulate, WorkersLostError, in_processes, in_this_process
from soilmoist_ros.lab.mission_store import CampaignRun, DamagedMissionError, MissionStore, StaleMissionError
from soilmoist_ros.lab.table import write_tables
from soilmoist_ros.mapping import require_covariates
from soilmoist_ros.simulation import surrogate_field

RUNS = "runs"
"""Folder of the finished missions inside the output folder."""
_RESUME = "run the same command again to resume"


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


class CampaignStoppedError(SoilmoistError):
    """The workers of the campaign are lost; the message states the progress and how to resume."""


def run_campaign(
    campaign: Campaign,
    out: Path,
    simulate: Simulate,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress = lambda state: None,
) -> CampaignOutcome:
    """Compute all missions of a campaign that are not stored yet, and write the tables.

    A mission depends on its settings alone: the number of processes and interruptions do not change the results.
    Each finished mission is stored at once in ``out/runs``. Stored missions are reused if they are complete and
    come from the current version of the code. Missions are computed seed by seed, so an unfinished campaign has
    about as many runs of each combination.

    :param simulate: simulates one mission; local processes and clusters need an importable function
    :param workers: local processes; one per core if ``None``, 0 computes in this process
    :param scheduler: address of a Dask scheduler, used instead of local processes
    :param progress: called at the start, after each mission, and while the campaign waits for workers
    :raises InputError: if the folder cannot be written or another campaign writes in it, the cluster cannot be
        reached, or a worker of it has another version of this package
    :raises CampaignInterrupted: on Ctrl-C; the running missions are ended
    :raises CampaignStoppedError: if the scheduler of the cluster does not answer any more
    """
    if workers is not None and workers < 0:
        raise InputError(f"the number of processes cannot be {workers}", "give 0 or more")
    for needed in ("pandas", "pyarrow"):  # pandas imports pyarrow only when it writes
        optional_module(needed)
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
        pace = Pace(len(wanted), len(todo), progress)

        def stored_text() -> str:
            return f"{len(runs)} of {len(wanted)} missions are stored in {store.folder}; {_RESUME}"

        with closing(_computed(todo, simulate, workers, scheduler, pace)) as computed:
            try:
                for finished in computed:
                    mission, content = finished.mission, finished.content
                    if isinstance(content, bytes):
                        try:
                            runs[mission.key] = store.write(mission, content)
                        except DamagedMissionError as error:
                            content = Failure(mission, f"its result {error}")
                    if isinstance(content, Failure):
                        failures[mission.key] = content
                    pace.finished(finished.time_s, isinstance(content, Failure))
            except KeyboardInterrupt:
                computed.close()
                raise CampaignInterrupted(f"stopped: {stored_text()}") from None
            except WorkersLostError as error:
                raise CampaignStoppedError(f"{error}: {stored_text()}") from None
        in_order = tuple((mission, runs[mission.key]) for mission in wanted if mission.key in runs)
        return CampaignOutcome(
            computed=len(runs) - reused, reused=reused,
            failures=tuple(failures[m.key] for m in wanted if m.key in failures), remarks=tuple(remarks),
            written=tuple(write_tables(out, in_order, campaign.table_every_s)), runs=in_order,
        )  # fmt: skip


def _already_done(wanted: list[CampaignMission], store: MissionStore) -> tuple[dict[str, CampaignRun], list[str]]:
    """Finished missions by key, and remarks on files that cannot be used."""
    runs: dict[str, CampaignRun] = {}
    remarks, stale = [], 0
    for mission in wanted:
        try:
            stored = store.read(mission)
        except StaleMissionError:
            stale += 1
            continue
        except DamagedMissionError as error:
            remarks.append(f"{error}: computed again")
            continue
        if stored is not None:
            runs[mission.key] = stored
    if stale:
        remarks.append(f"{stale} stored missions were computed by another version of the code: computed again")
    return runs, remarks


def _computed(
    todo: list[CampaignMission], simulate: Simulate, workers: int | None, scheduler: str | None, pace: Pace
) -> Flow:
    if not todo:
        return in_this_process((), simulate)
    if scheduler is not None:
        optional_module("distributed")
        from soilmoist_ros.lab.cluster import on_cluster

        return on_cluster(todo, simulate, scheduler, pace.waits)
    count = cores() if workers is None else workers
    return in_processes(todo, simulate, count) if count else in_this_process(todo, simulate)


# Progress of a campaign: missions done, missions a minute, and the time left ------------------------------------


@dataclass(frozen=True)
class CampaignProgress:
    """State of a campaign; a rate or time is NaN while unknown."""

    done: int  # missions that have come to their end, failed and reused ones too
    total: int
    failed: int = 0
    per_minute: float = math.nan  # missions a minute since the first mission of this run began
    left_s: float = math.nan  # estimated time left [s]
    note: str = ""  # what the campaign waits for; usually empty

    def __str__(self) -> str:
        parts = [f"{self.done} of {self.total} missions"]
        if self.failed:
            parts.append(f"{self.failed} failed")
        if self.per_minute > 0:
            parts.append(f"{self.per_minute:.{0 if self.per_minute >= 10 else 1}f} a minute")
        if self.left_s > 0:
            parts.append(f"{duration(self.left_s)} left")
        return " · ".join([*parts, self.note] if self.note else parts)


Progress = Callable[[CampaignProgress], None]


class Pace:
    """Counts missions and estimates the time left by the pace since the first of them began.

    :param todo: number of missions that are not stored yet
    :param progress: called at once, and after each mission
    """

    def __init__(
        self, total: int, todo: int, progress: Progress, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._progress, self._clock, self._at_start = progress, clock, total - todo
        self._began_s: float | None = None
        self.state = CampaignProgress(self._at_start, total, left_s=math.nan if todo else 0.0)
        progress(self.state)

    def finished(self, time_s: float, failed: bool = False) -> None:
        """Count a mission that took its worker this time [s]; NaN if unknown."""
        now_s = self._clock()
        if self._began_s is None:  # what starts the workers is no part of the pace
            self._began_s = now_s - time_s if time_s >= 0 else now_s
        done, elapsed_s = self.state.done + 1, now_s - self._began_s
        each_s = elapsed_s / (done - self._at_start) if elapsed_s > 0 else math.nan
        self.state = replace(
            self.state, done=done, failed=self.state.failed + failed, per_minute=60 / each_s,
            left_s=(self.state.total - done) * each_s,
        )  # fmt: skip
        self._progress(self.state)

    def waits(self, note: str) -> None:
        """Report what the campaign waits for."""
        self._progress(replace(self.state, note=note))
