"""Run campaigns: simulate missions in parallel, store each, and collect them in tables."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.workers import cores
from soilmoist_ros.simulation.campaign.campaign_file import Campaign, Mission, load_campaign, mission_key, missions
from soilmoist_ros.simulation.campaign.mission_store import (
    DamagedMissionError,
    MissionStore,
    StaleMissionError,
    StoredMission,
)
from soilmoist_ros.simulation.campaign.table import require_pandas, write_tables
from soilmoist_ros.simulation.campaign.workers import (
    Failure,
    Flow,
    Simulate,
    in_processes,
    in_this_process,
    on_cluster,
)

__all__ = [
    "Campaign",
    "CampaignInterrupted",
    "CampaignOutcome",
    "Failure",
    "Mission",
    "load_campaign",
    "mission_key",
    "missions",
    "run_campaign",
    "stored_missions",
]

RUNS = "runs"
"""Folder of the finished missions inside the output folder."""

Progress = Callable[[int, int, float], None]
"""Called with the number of finished missions, the total, and the estimated time left [s] (NaN while unknown)."""


@dataclass(frozen=True)
class CampaignOutcome:
    """Result of a campaign.

    :param total: missions of the campaign
    :param computed: missions computed now
    :param reused: stored missions that were reused
    :param failures: failed missions, in the order of the campaign; the tables contain all other missions
    :param remarks: notes for the user, such as damaged files whose missions were computed again
    :param written: paths of the tables
    """

    total: int
    computed: int
    reused: int
    failures: tuple[Failure, ...]
    remarks: tuple[str, ...]
    written: tuple[Path, ...]

    @property
    def complete(self) -> bool:
        """Whether every mission finished."""
        return not self.failures


class CampaignInterrupted(KeyboardInterrupt):
    """The user interrupted the campaign; the message states the progress and how to resume.

    :param done: missions stored
    :param total: missions of the campaign
    :param out: output folder
    """

    def __init__(self, done: int, total: int, out: Path) -> None:
        self.done, self.total, self.out = done, total, out
        super().__init__(
            f"stopped: {done} of {total} missions are stored in {out / RUNS}; run the same command again to resume"
        )


def run_campaign(
    campaign: Campaign,
    out: Path,
    simulate: Simulate,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress = lambda done, total, left_s: None,
) -> CampaignOutcome:
    """Compute all missions of a campaign that are not stored yet, and write the tables.

    A mission depends on its settings alone: the number of processes and interruptions do not change the results.
    Each finished mission is stored at once in ``out/runs``. Stored missions are reused if they are complete and
    come from the current version of the code.

    :param campaign: campaign from :func:`load_campaign`
    :param out: output folder; created if missing
    :param simulate: simulates one mission; local processes and clusters need an importable function
    :param workers: local processes; one per core if ``None``, 0 computes in this process
    :param scheduler: address of a Dask scheduler, used instead of local processes
    :param progress: called at the start and after each mission
    :raises InputError: if the folder cannot be written, or the cluster cannot be reached
    :raises CampaignInterrupted: on Ctrl-C, after the running missions have stopped
    """
    if workers is not None and workers < 0:
        raise InputError(f"the number of processes cannot be {workers}", "give 0 or more")
    require_pandas()
    wanted = missions(campaign)
    store = MissionStore(out / RUNS)
    finished, remarks = _already_done(wanted, store)
    reused = len(finished)
    todo = [mission for mission in wanted if mission.key not in finished]
    failures: dict[str, Failure] = {}
    clock = _Clock(len(wanted), reused, progress)
    with closing(_computed(todo, simulate, workers, scheduler)) as computed:
        try:
            for mission, content in computed:
                if isinstance(content, bytes):
                    try:
                        finished[mission.key] = store.write(mission, content)
                    except DamagedMissionError as error:
                        content = Failure(mission, f"its result {error}")
                if isinstance(content, Failure):
                    failures[mission.key] = content
                clock.tick()
        except KeyboardInterrupt:
            computed.close()
            raise CampaignInterrupted(len(finished), len(wanted), out) from None
    written = write_tables(out, campaign, [(m, finished[m.key]) for m in wanted if m.key in finished])
    return CampaignOutcome(
        total=len(wanted),
        computed=len(finished) - reused,
        reused=reused,
        failures=tuple(failures[m.key] for m in wanted if m.key in failures),
        remarks=tuple(remarks),
        written=tuple(written),
    )


def stored_missions(campaign: Campaign, out: Path) -> list[tuple[Mission, StoredMission]]:
    """The finished missions of a campaign in its output folder, in the order of the campaign."""
    wanted = missions(campaign)
    finished, _ = _already_done(wanted, MissionStore(out / RUNS))
    return [(mission, finished[mission.key]) for mission in wanted if mission.key in finished]


def _already_done(wanted: list[Mission], store: MissionStore) -> tuple[dict[str, StoredMission], list[str]]:
    """Finished missions by key, and remarks on files that cannot be used."""
    finished: dict[str, StoredMission] = {}
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
            finished[mission.key] = stored
    if stale:
        remarks.append(f"{stale} stored missions were computed by another version of the code: computed again")
    return finished, remarks


def _computed(todo: list[Mission], simulate: Simulate, workers: int | None, scheduler: str | None) -> Flow:
    if not todo:
        return in_this_process((), simulate)
    if scheduler is not None:
        return on_cluster(todo, simulate, scheduler)
    count = cores() if workers is None else workers
    return in_processes(todo, simulate, count) if count else in_this_process(todo, simulate)


class _Clock:
    """Counts missions and estimates the remaining time from the pace so far."""

    def __init__(self, total: int, done: int, progress: Progress) -> None:
        self._total, self._done, self._at_start = total, done, done
        self._progress, self._started_s = progress, time.monotonic()
        progress(done, total, 0.0 if done == total else float("nan"))

    def tick(self) -> None:
        self._done += 1
        pace_s = (time.monotonic() - self._started_s) / (self._done - self._at_start)
        self._progress(self._done, self._total, pace_s * (self._total - self._done))
