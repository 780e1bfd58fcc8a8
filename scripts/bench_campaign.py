# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Campaigns on a Dask cluster: missions per CPU second of the workers, overhead of a mission, and memory.

usage: .venv/bin/python scripts/bench_campaign.py [--missions 1000] [--trivial 10000] [--quick]
       [--save]

Starts a scheduler and workers on loopback. The plain loop simulates and packs the same missions in one process,
half of them before and half of them after the campaigns, because the speed of a shared machine drifts.
"""

from __future__ import annotations

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil  # type: ignore[import-untyped]
import results

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.foundation.workers import connect
from soilmoist_ros.lab.campaign import CampaignProgress, load_campaign, missions, run_campaign
from soilmoist_ros.lab.campaign_file import Campaign
from soilmoist_ros.lab.computing import compute
from soilmoist_ros.simulation.mission.mission_result import MappedProperty, MissionResult
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.simulator import simulate_mission

SETTINGS = "{field: synthetic-high, strategy: greedy, preset: paper, hours: 2, cell_m: 4}"
WARM = 0.2
"""Share of the trivial missions after which memory is measured first; modules are loaded then."""


def main() -> None:
    parser = results.parser(__doc__)
    parser.add_argument("--missions", type=int, default=1000)
    parser.add_argument("--trivial", type=int, default=10_000)
    parser.add_argument("--quick", action="store_true", help="a twentieth of the missions")
    options = parser.parse_args()
    share = 20 if options.quick else 1
    with tempfile.TemporaryDirectory() as folder:
        efficiency(options.missions // share, Path(folder), options.save)
        memory(options.trivial // share, Path(folder), options.save)


def efficiency(count: int, folder: Path, save: bool) -> None:
    """Missions per CPU second of the workers, for a plain loop and 1 and 2 workers."""
    plan = campaign(folder, count)
    loop_s = loop_cpu_s(plan, slice(0, None, 2))
    used_s = {}
    for workers in (1, 2):
        with cluster(workers) as (address, processes):
            warm_up(address, plan)
            before_s = cpu_s(processes["workers"])
            run_campaign(plan, folder / str(workers), simulate_mission, scheduler=address)
            used_s[workers] = cpu_s(processes["workers"]) - before_s
    loop_s += loop_cpu_s(plan, slice(1, None, 2))
    rows = [
        (name, f"{count / spent_s:.1f}", f"{loop_s / spent_s:.0%}", f"{1e3 * (spent_s - loop_s) / count:.1f}")
        for name, spent_s in (("plain loop", loop_s), ("1 worker", used_s[1]), ("2 workers", used_s[2]))
    ]
    columns = ("", "missions per CPU second of the workers", "of the plain loop", "overhead of a mission [ms]")
    results.publish("cluster", columns, rows, f"{count} missions of {SETTINGS}", save)


def memory(count: int, folder: Path, save: bool) -> None:
    """Memory of client, scheduler and workers during trivial missions."""
    plan = campaign(folder, count)
    with cluster(2) as (address, processes):
        processes["client"] = [psutil.Process()]
        seen: list[dict[str, float]] = []

        def look(state: CampaignProgress) -> None:
            if state.done in (int(WARM * count), count):
                seen.append({name: rss_mb(listed) for name, listed in processes.items()})

        start_s, before_s = time.monotonic(), cpu_s(processes["workers"])
        run_campaign(plan, folder / "trivial", trivial, scheduler=address, progress=look)
        taken_s, used_s = time.monotonic() - start_s, cpu_s(processes["workers"]) - before_s
    columns = ("memory [MB]", f"after {int(WARM * count):,}", f"after {count:,}")
    rows = [(name, *(f"{megabytes[name]:.0f}" for megabytes in seen)) for name in seen[0]]
    each_ms = 1e3 * used_s / count
    settings = (
        f"{count:,} trivial missions, {count / taken_s:.0f} a second, {each_ms:.1f} ms of the 2 workers each"
    )
    results.publish("cluster_memory", columns, rows, settings, save)


def campaign(folder: Path, count: int) -> Campaign:
    """A campaign of equal missions that differ by their seeds."""
    path = folder / "campaign.yaml"
    path.write_text(f"title: bench\nruns: {count}\ndefaults: {SETTINGS}\nexperiments: [{{name: a}}]\n")
    return load_campaign(str(path))


def trivial(settings: MissionSettings, progress: Callable[[float], None] | None = None) -> MissionResult:
    """A mission without a visit."""
    mapped = MappedProperty("trivial", "Trivial", (), None, np.empty((0, 0)))
    track = np.zeros((2, 2))
    return MissionResult(settings, [], [], (track,), [mapped], LocalFrame(53.0, 0.0), "time is up")


def loop_cpu_s(plan: Campaign, part: slice) -> float:
    """CPU time of a part of the missions in this process [s]."""
    listed = missions(plan)
    compute(listed[0], simulate_mission)  # imports, and the field
    start_s = time.process_time()
    for mission in listed[part]:
        compute(mission, simulate_mission)
    return time.process_time() - start_s


def warm_up(address: str, plan: Campaign) -> None:
    """Load modules and field in all workers, as their first missions do."""
    with connect(address) as client:
        client.run(loop_cpu_s, plan, slice(0, 0))


@contextmanager
def cluster(workers: int) -> Iterator[tuple[str, dict[str, list[psutil.Process]]]]:
    """A scheduler and workers on loopback: address and processes."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    dask = [sys.executable, "-m", "dask"]
    scheduler = [*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    worker = [*dask, "worker", address, "--nthreads", "1", "--nworkers", str(workers), "--no-dashboard"]
    quiet = subprocess.DEVNULL
    started = [subprocess.Popen(command, stdout=quiet, stderr=quiet) for command in (scheduler, worker)]
    try:
        deadline_s = time.monotonic() + 60
        while True:
            try:
                with connect(address) as client:
                    client.wait_for_workers(workers, timeout=60)
                break
            except Exception:
                if time.monotonic() > deadline_s:
                    raise
        nanny = psutil.Process(started[1].pid)
        listed = [nanny, *nanny.children(recursive=True)]
        yield address, {"scheduler": [psutil.Process(started[0].pid)], "workers": listed}
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait()


def cpu_s(processes: Sequence[psutil.Process]) -> float:
    """CPU time of processes [s]."""
    return float(sum(times.user + times.system for times in (process.cpu_times() for process in processes)))


def rss_mb(processes: Sequence[psutil.Process]) -> float:
    """Resident memory of processes [MB]."""
    return float(sum(process.memory_info().rss for process in processes) / 1e6)


if __name__ == "__main__":
    main()
