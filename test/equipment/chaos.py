#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Puts the real nodes through random faults, and counts what must not happen.

usage: .venv/bin/python test/equipment/chaos.py [--runs N] [--seed S] [--only NUMBER] [--out FOLDER]

Each run is a mission of driver, mapper, planner, recorder and simulator as processes, in accelerated time. Seed
and number draw field, strategy, navigator and faults: nodes are killed, links are cut or full of garbage, the
receiver is wrong, the clock is set, the disk is full, a bag is deleted, the navigation fails, and people
interfere. The judge of scripts/safety sees all that was published. Each run is one line of FOLDER/chaos.jsonl; the
same command goes on after the last one. A run with a violation keeps its folder, and says how to run it again. The
exit code is 1 on any violation. It needs a C compiler.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import time
from dataclasses import dataclass
from pathlib import Path

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # rehearsals

import numpy as np
import yaml
from disturbed_nodes import ON_NODES, Disturber, judged, scenario_of
from real_nodes import NodesSettings, RealNodes

from rehearsal.cases import Faults, random_faults
from rehearsal.judge import Kind, Violation
from soilmoist_ros.exploration import BUILT_IN, Phase
from soilmoist_ros.foundation.configuration import config_folder
from soilmoist_ros.nodes.process_group import free_domain
from soilmoist_ros.simulation.mission.settings import MissionSettings

FIELDS = ("rough", "patches", "smooth", "strips")
NAVIGATORS = ("goto_node", "navigate_to_pose")
STRATEGIES = [one for one in BUILT_IN if one not in ("lattice", "monte_carlo")]
BUDGET_S = 1500.0
OVERTIME_S = 1200.0
"""A mission that has not ended this long after its budget waits for something, and must say for what [s]."""
WALL_S = 600.0
"""Longest time of a run [s of the wall clock]."""
PUT_BACK_S = 30.0


@dataclass(frozen=True)
class Chaos:
    """What a run is.

    :param field: name of the simulated field
    :param strategy: how stops are chosen
    :param navigator: how goals are sent
    :param faults: all that goes wrong
    """

    field: str
    strategy: str
    navigator: str
    faults: Faults

    def __str__(self) -> str:
        return f"{self.field}, {self.strategy}, {self.navigator}; faults: {self.faults}"


def make_chaos(seed: int, number: int) -> Chaos:
    """A run by seed and number; first faults take turns."""
    rng = np.random.default_rng([seed, number])
    first = ON_NODES[number * 7 % len(ON_NODES)]
    drawn = random_faults(rng, first, int(rng.integers(1, 5)), 0.6 * BUDGET_S)
    spans = [span for span in drawn.spans if span.fault in ON_NODES]
    navigator = NAVIGATORS[int(rng.integers(2))]
    field, strategy = FIELDS[int(rng.integers(len(FIELDS)))], STRATEGIES[int(rng.integers(len(STRATEGIES)))]
    return Chaos(field, strategy, navigator, Faults(spans))


def run(chaos: Chaos, seed: int, out: Path, time_factor: float) -> tuple[list[Violation], dict[str, object]]:
    spans, began_s = chaos.faults.spans, time.monotonic()
    settings = NodesSettings(
        out=out,
        mission=MissionSettings(
            field=field_with_pond(chaos.field, out), strategy=chaos.strategy, hours=BUDGET_S / 3600, seed=seed
        ),
        time_factor=time_factor,
        navigator=chaos.navigator,
        scenario=scenario_of(spans, chaos.navigator),
    )
    with free_domain() as domain, RealNodes(settings, domain) as nodes:
        disturber = Disturber(nodes, spans, BUDGET_S)
        ended_s = None
        while nodes.operator.now_s < BUDGET_S + OVERTIME_S and time.monotonic() - began_s < WALL_S:
            time.sleep(0.05)
            disturber.step()
            if nodes.ended():
                break
            now_s, status = nodes.operator.now_s, nodes.operator.status
            over = status is not None and (status.phase is Phase.FINISHED or status.ended is not None)
            ended_s = (now_s if ended_s is None else ended_s) if over else None
            if ended_s is not None and now_s > ended_s + PUT_BACK_S and not disturber.busy:
                break
        crashed = nodes.ended()
        disturber.put_back()
        nodes.settle()
        nodes.stop()
        violations = judged(nodes, spans, disturber.acts, BUDGET_S)
        for name, code in crashed.items():
            violations.append(Violation(Kind.CRASH, nodes.operator.now_s, f"{name} ended with code {code}"))
        (out / "acts.txt").write_text("\n".join(disturber.log))
        heard, status = nodes.operator.heard, nodes.operator.status
        figures = {
            "records": len(heard.records),
            "visits": len(heard.visits),
            "goals": len(nodes.witnessed().goals),
            "kills": sum(nodes.restarts.values()),
            "simulated_s": round(nodes.operator.now_s),
            "wall_s": round(time.monotonic() - began_s),
            "ended": "" if status is None else f"{status.phase}: {status.reason}",
        }
    return violations, figures


def field_with_pond(name: str, out: Path) -> str:
    """A surrogate field with a no-go area in its middle, as a file; returns its path."""
    out.mkdir(parents=True, exist_ok=True)
    source = config_folder() / "fields" / f"{name}.yaml"
    content = yaml.safe_load(source.read_text())
    middle = np.mean(content["polygon"], axis=0)
    corners = middle + 6.0 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    path = out / f"{name}_pond.yaml"
    path.write_text(yaml.safe_dump(content | {"no_go": [corners.tolist()]}))
    return str(path)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20, help="number of runs (default 20)")
    parser.add_argument("--seed", type=int, default=1, help="seed of everything random (default 1)")
    parser.add_argument("--only", type=int, help="run this number again, and show what people and faults did")
    parser.add_argument(
        "--time-factor", type=float, default=20.0, help="simulated seconds for each second (default 20)"
    )
    parser.add_argument("--out", type=Path, default=Path("out/chaos"), help="folder (default out/chaos)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / "chaos.jsonl"
    lines = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    done = {line["number"] for line in lines if line["seed"] == options.seed}
    numbers = [options.only] if options.only is not None else [n for n in range(options.runs) if n not in done]
    for number in numbers:
        chaos, folder = make_chaos(options.seed, number), options.out / f"run_{options.seed}_{number}"
        shutil.rmtree(folder, ignore_errors=True)
        violations, figures = run(chaos, options.seed * 1000 + number, folder, options.time_factor)
        line = {"seed": options.seed, "number": number, **figures, "violations": [str(one) for one in violations]}
        print(f"{number}: {figures}\n    {chaos}", flush=True)
        for one in violations:
            print(f"--seed {options.seed} --only {number}: {one}", flush=True)
        if options.only is not None:
            print((folder / "acts.txt").read_text())
            return 1 if violations else 0
        lines.append(line)
        with file.open("a") as kept:
            kept.write(json.dumps(line) + "\n")
        if not violations:
            shutil.rmtree(folder)
    lines = [line for line in lines if line["seed"] == options.seed]
    total = sum(len(line["violations"]) for line in lines)
    print(
        f"{len(lines)} runs: {sum(line['records'] for line in lines)} records, "
        f"{sum(line['visits'] for line in lines)} visits, {sum(line['kills'] for line in lines)} kills\n"
        f"violations: {total}"
    )
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())
