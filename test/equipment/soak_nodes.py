# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lets the real nodes work for a simulated day: nothing may grow, and nothing may be lost.

usage: .venv/bin/python test/equipment/soak_nodes.py [--hours H] [--seed S] [--time-factor F] [--out FOLDER]

Driver, mapper, planner, recorder and simulator run in accelerated time, with missions of two hours one after the
other. Links are cut and full of garbage, navigation and receiver fail, the clock is set, the disk is full, a bag
is deleted, people interfere, and in the first hours nodes are killed. A sample of every process is a line of
FOLDER/soak_nodes.jsonl. The same command goes on after the last one, as after a power cut. It needs a C compiler.
The exit code is 1 if a record was lost, the judge found a violation, or something grew.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import statistics
import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # rehearsals

from disturbed_nodes import Disturber, judged, scenario_of
from real_nodes import ON_ROBOT, NodesSettings, RealNodes

from rehearsal.cases import Fault, Span
from soilmoist_ros.exploration.mission.types import Phase
from soilmoist_ros.nodes.process_group import free_domain
from soilmoist_ros.simulation.mission.settings import MissionSettings

NODES = (*ON_ROBOT, "field_simulator")
MISSION_H = 2.0
FILE_MB = 4.0
KEEP_GB = 0.04
"""Parts and sum of the recordings: the oldest are deleted, so that a day needs a bounded disk."""
PERIODS_S = {
    Fault.LINK_CUT: 5400.0, Fault.LINK_STALL: 7200.0, Fault.LINK_GARBAGE: 3600.0, Fault.SENSOR_SILENT: 9000.0,
    Fault.FIX_SILENT: 7200.0, Fault.FIX_JUMP: 14_400.0, Fault.SERVER_DEAD: 10_800.0, Fault.CLOCK_BACK: 14_400.0,
    Fault.CLOCK_FORWARD: 14_400.0, Fault.DISK_FULL: 21_600.0, Fault.PAUSE: 10_800.0, Fault.EMERGENCY: 14_400.0,
    Fault.SKIP: 5400.0, Fault.MEASURE: 7200.0, Fault.REORDER: 14_400.0, Fault.MAPPER_SILENT: 14_400.0,
    Fault.RETURN: 28_800.0,
}  # fmt: skip
"""Mean time between two faults of a kind [s]."""
OF_GOALS = (Fault.SERVER_ABORTS, Fault.SERVER_LIES, Fault.SERVER_HANGS)
KILLS = (Fault.KILL_PLANNER, Fault.KILL_MAPPER, Fault.KILL_DRIVER, Fault.KILL_RECORDER)
KILLED_UNTIL = 0.3
"""Share of the time in which nodes are killed; afterwards their processes last, so that growth shows."""
GROWTH_MB, GROWTH_HANDLES, GROWTH_THREADS, GROWTH_WORK = 8.0, 2, 1, 0.5
"""Growth allowed from the second quarter of a life to the last one; that of processor time is a share."""


@dataclass(frozen=True)
class Sample:
    """One look at all nodes.

    :param session: number of the session, from 0; a resumed soak begins another
    :param at_s: simulated time since the very start [s]
    :param wall_s: time since the start of the session [s]
    :param nodes: of each node: number of its process, memory [MB], open files, threads, processor time [s]
    :param update_ms: mean time from a record to the merged samples since the last look [ms]; 0 without one
    :param bag_mb: size of all recordings [MB]
    :param journal_mb: size of the planner's journal [MB]
    :param log_mb: size of the logs of records [MB]
    """

    session: int
    at_s: float
    wall_s: float
    nodes: dict[str, tuple[int, float, int, int, float]]
    update_ms: float
    bag_mb: float
    journal_mb: float
    log_mb: float


def day_of_faults(hours: float, seed: int) -> list[Span]:
    rng, until_s = random.Random(seed), hours * 3600.0 - 1200.0
    spans = [Span(fault, 0.0, until_s, rng.random()) for fault in OF_GOALS]
    for fault, period_s in PERIODS_S.items():
        at_s = rng.uniform(300.0, period_s)
        while at_s < until_s:
            spans.append(Span(fault, at_s, rng.uniform(10.0, 120.0), rng.random() * 0.5))
            at_s += rng.uniform(0.5, 1.5) * period_s
    kills_s = KILLED_UNTIL * hours * 3600.0
    for number in range(2 * len(KILLS)):
        at_s = kills_s * (number + rng.uniform(0.2, 0.8)) / (2 * len(KILLS))
        spans.append(Span(KILLS[number % len(KILLS)], at_s, 1.0, 0.0))
    spans.append(Span(Fault.BAG_DELETED, kills_s * rng.uniform(0.3, 0.9), 1.0, 0.0))
    return sorted(spans, key=lambda span: span.at_s)


def soak_nodes(options: argparse.Namespace) -> int:
    """Run the nodes until the hours are full; the same command goes on where it was interrupted."""
    file, end_s = options.out / "soak_nodes.jsonl", options.hours * 3600.0
    samples = [Sample(**json.loads(line)) for line in file.read_text().splitlines()] if file.exists() else []
    begin_s = samples[-1].at_s if samples else 0.0
    session = samples[-1].session + 1 if samples else 0
    if begin_s >= end_s:
        return report(samples, [])
    spans = day_of_faults(options.hours, options.seed)
    print(f"{len(spans)} faults in {options.hours:g} h; from {begin_s / 3600:.1f} h on", flush=True)
    settings = NodesSettings(
        out=options.out / "nodes", mission=MissionSettings(field="rough", hours=MISSION_H, seed=options.seed),
        time_factor=options.time_factor, scenario=scenario_of(spans, begin_s=begin_s), begin_s=begin_s,
        more={"recorder": {"file_mb": FILE_MB, "keep_gb": KEEP_GB, "delete_oldest": True}},
    )  # fmt: skip
    with free_domain() as domain, RealNodes(settings, domain) as nodes:
        later = [span for span in spans if span.at_s >= begin_s]
        disturber = Disturber(nodes, later, MISSION_H * 3600.0)
        began_s = looked_s = started_s = time.monotonic()
        while nodes.operator.now_s < end_s:
            time.sleep(0.1)
            disturber.step()
            status = nodes.operator.status
            over = status is not None and status.phase in (Phase.FINISHED, Phase.IDLE)
            if over and not disturber.busy and time.monotonic() - started_s > 5.0:
                started_s = time.monotonic()
                disturber.start()
            if ended := nodes.ended():
                print(f"ended by themselves: {ended}")
                break
            if time.monotonic() - looked_s >= options.sample_s:
                looked_s = time.monotonic()
                samples.append(look(nodes, session, looked_s - began_s))
                with file.open("a") as lines:
                    lines.write(json.dumps(asdict(samples[-1])) + "\n")
                print(line_of(samples[-1], begin_s), flush=True)
        faults = [f"{name} ended with code {code}" for name, code in nodes.ended().items()]
        disturber.end()
        nodes.settle()
        nodes.stop()
        faults += [str(one) for one in judged(nodes, spans, disturber.acts, MISSION_H * 3600.0)]
        (options.out / f"acts{session}.txt").write_text("\n".join(disturber.log))
    return report(samples, faults)


def look(nodes: RealNodes, session: int, wall_s: float) -> Sample:
    figures = {}
    for name in NODES:
        try:
            figures[name] = figures_of(nodes.pid(name))
        except (KeyError, OSError):  # it is being started again
            continue
    out = nodes.settings.out
    sizes = (size_mb(out / "bags"), size_mb(out / "journal"), size_mb(nodes.session))
    return Sample(session, nodes.operator.now_s, wall_s, figures, nodes.operator.update_ms(), *sizes)


def figures_of(pid: int) -> tuple[int, float, int, int, float]:
    """Number, resident memory [MB], open files, threads and processor time [s] of a process."""
    status = Path(f"/proc/{pid}/status").read_text()
    found = re.search(r"VmRSS:\s+(\d+)", status)
    ticks = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    spent_s = sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")
    memory_mb = round(int(found[1]) / 1024, 1) if found else 0.0
    return pid, memory_mb, len(os.listdir(f"/proc/{pid}/fd")), len(os.listdir(f"/proc/{pid}/task")), spent_s


def size_mb(folder: Path) -> float:
    """Size of all files below a folder [MB]; some may go meanwhile."""
    total = 0
    for path in folder.rglob("*"):
        try:
            total += path.stat().st_size
        except OSError:
            continue
    return round(total / 1e6, 3)


def line_of(sample: Sample, begin_s: float) -> str:
    factor = (sample.at_s - begin_s) / max(sample.wall_s, 1.0)
    memory = "  ".join(f"{name} {each[1]:.0f}" for name, each in sample.nodes.items())
    return (
        f"{sample.at_s / 3600:5.2f} h at {factor:.0f} x: {memory} MB; update {sample.update_ms:.0f} ms, "
        f"bags {sample.bag_mb:.1f}, journal {sample.journal_mb:.2f}, logs {sample.log_mb:.2f} MB"
    )


def report(samples: Sequence[Sample], faults: list[str]) -> int:
    """Print what grew and what else must not have happened; returns the exit code."""
    faults = [*faults, *grown(samples)]
    bag_mb, journal_mb = (max(getattr(one, what) for one in samples) for what in ("bag_mb", "journal_mb"))
    print(f"{samples[-1].at_s / 3600:.1f} h; at most {bag_mb:.1f} MB of bags, {journal_mb:.2f} MB of journal")
    print("\n".join(faults) if faults else "nothing grew, nothing was lost, no violation")
    return 1 if faults else 0


Life = list[tuple[float, float, float, float, float]]


def lives_of(samples: Sequence[Sample], name: str) -> list[Life]:
    """Time, memory, handles, threads and processor time of each process of a node."""
    found: dict[tuple[int, int], Life] = defaultdict(list)
    for sample in samples:
        if name in sample.nodes:
            pid, *figures = sample.nodes[name]
            found[sample.session, pid].append((sample.at_s, *figures))
    return list(found.values())


def parts(life: Life) -> tuple[list[float], list[float]]:
    """Medians of the second quarter and of the last one: the first has caches that fill."""
    quarter = max(1, len(life) // 4)
    return tuple(
        [statistics.median(column) for column in zip(*part, strict=True)]
        for part in (life[quarter : 2 * quarter] or life, life[-quarter:])
    )


def work(life: Life) -> tuple[float, float]:
    """Processor time of a simulated hour, in the second quarter and in the last one [s]."""
    quarter = max(1, len(life) // 4)
    spans = ((life[quarter], life[2 * quarter]), (life[-quarter - 1], life[-1]))
    early_s, late_s = (3600.0 * (end[4] - begin[4]) / (end[0] - begin[0]) for begin, end in spans)
    return early_s, late_s


def grown(samples: Sequence[Sample]) -> list[str]:
    """What grew in the process of each node that lasted longest.

    In shorter ones the first map that is saved, and the libraries it needs, may come after the first quarter.
    """
    faults = []
    for name in NODES:
        life = max(lives_of(samples, name), key=len, default=[])
        if len(life) < 12:
            continue
        early, late = parts(life)
        for index, (what, limit) in enumerate(
            (("memory [MB]", GROWTH_MB), ("handles", GROWTH_HANDLES), ("threads", GROWTH_THREADS)), 1
        ):
            if late[index] - early[index] > limit:
                faults.append(f"{name}: {what} have grown from {early[index]:g} to {late[index]:g}")
        early_s, late_s = work(life)
        if late_s > (1 + GROWTH_WORK) * early_s:
            faults.append(f"{name}: an hour took {early_s:.1f} s of processor time, and takes {late_s:.1f} s")
    return faults


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=24.0, help="simulated hours (default 24)")
    parser.add_argument("--seed", type=int, default=1, help="seed of everything random (default 1)")
    parser.add_argument("--time-factor", type=float, default=30.0, help="simulated seconds a second (default 30)")
    parser.add_argument("--sample-s", type=float, default=20.0, help="time between samples [s]")
    parser.add_argument("--out", type=Path, default=Path("out/soak"), help="folder (default out/soak)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    return soak_nodes(options)


if __name__ == "__main__":
    sys.exit(main())
