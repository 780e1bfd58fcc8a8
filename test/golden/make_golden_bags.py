# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Makes the golden bags: tiny recordings, one per case, with the expected results of a replay.

``python test/golden/make_golden_bags.py`` writes the bags to the folder of this file. The code of the nodes makes
the messages. Make the bags again only when a message changes, and review the change.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # virtual_survey

import soilmoist_ros.nodes  # noqa: F401 - one thread, before numpy is imported

# isort: split
import numpy as np
from rclpy.serialization import serialize_message

from msg_adapters.counts import counts_from_message, counts_to_message, line_to_message, samples_to_message
from msg_adapters.mission import mission_to_message
from msg_adapters.soil_map import soil_map_to_message
from soilmoist_ros.exploration import Action, MissionStatus, Publish, RequestPlan
from soilmoist_ros.mapping.field_map import FieldMap
from soilmoist_ros.pipeline import MapRun, MapSettings, ReplaySettings, map_logs, replay_bag
from soilmoist_ros.pipeline.field_survey import open_survey
from soilmoist_ros.recording import BagWriter, Qos, Topic, find_definition, write_parameters
from soilmoist_ros.sensing import CountRecord, Track, parse_log, parse_nmea, process_logs
from soilmoist_ros.sensing.records import NAN
from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.fields.surrogate_field import write_field_file, write_site_file
from soilmoist_ros.simulation.mission import simulator as mission_simulator
from soilmoist_ros.simulation.mission.mission_result import MissionResult
from soilmoist_ros.simulation.mission.settings import MissionSettings
from virtual_survey import START_S, simulate_log, stop_and_go

HERE = Path(__file__).resolve().parent
FIELD = "half-wet"
CELL_M = 4.0
Event = CountRecord | MissionStatus | tuple[str, str] | None
"""Published event: a record, a status, a line of a device (topic, text), or the map of all records so far."""


class Robot:
    """Writes messages to a bag as the nodes of one robot would publish them.

    :param writer: the bag
    :param run: folder of the run, with the configuration
    :param namespace: namespace of the robot
    """

    def __init__(self, writer: BagWriter, run: Path, namespace: str = "") -> None:
        self._writer = writer
        self._namespace = namespace
        self.online: FieldMap = open_survey(
            str(run / "configuration" / "field.yaml"), str(run / "configuration" / "site.yaml"), cell_m=CELL_M
        ).map
        self._now_s = START_S

    def publish(self, event: Event) -> None:
        if isinstance(event, CountRecord):
            self._now_s = event.stamp_s
            message = counts_to_message([event])
            self._write("counts", "sensor_msgs/msg/PointCloud2", message)
            for record in counts_from_message(message):
                self.online.add(record)
        elif isinstance(event, MissionStatus):
            self._now_s = event.now_s
            self._write("mission", "diagnostic_msgs/msg/DiagnosticStatus", mission_to_message(event))
        elif isinstance(event, tuple):
            self._write(event[0], "std_msgs/msg/String", line_to_message(event[1].encode("latin-1")))
        else:
            state = self.online.state
            soil_map = self.online.compute(state)
            samples = samples_to_message(state.samples, state.stamp_s)
            self._write("samples", "sensor_msgs/msg/PointCloud2", samples)
            message = soil_map_to_message(self.online.grid, soil_map, state.stamp_s)
            self._write("soil_map", "sensor_msgs/msg/PointCloud2", message)

    def _write(self, name: str, type_name: str, message: Any) -> None:
        topic = Topic(f"{self._namespace}/{name}", find_definition(type_name), (Qos(),))
        stamp_ns = round(self._now_s * 1e9)
        self._writer.write(topic, stamp_ns, stamp_ns, serialize_message(message))


def configure(run: Path, seed: int = 1) -> None:
    field = surrogate_field(FIELD)
    folder = run / "configuration"
    write_parameters(run, "planner", {"strategy": "greedy", "dwell": "fmi:60", "hours": 0.3, "seed": seed})
    write_field_file(field, folder / "field.yaml")
    write_site_file(field, folder / "site.yaml")
    # These paths do not exist: a replay finds the files in the configuration folder, wherever the folder is.
    files = {"field": "/run/configuration/field.yaml", "site": "/run/configuration/site.yaml"}
    write_parameters(run, "mapper", {**files, "cell_m": CELL_M, "noise": "local", "simulated": True})


def write_bag(run: Path, events: Iterable[Event]) -> None:
    configure(run)
    with BagWriter(run / "bag") as writer:
        robot = Robot(writer, run)
        for event in events:
            robot.publish(event)


def records(places: Sequence[tuple[float, float]], seed: int = 5) -> list[CountRecord]:
    rng = np.random.default_rng(seed)
    rate = surrogate_field(FIELD).rate_at(np.nan_to_num(np.array(places)))
    noise = rng.normal(0, 0.02, (len(places), 2))
    return [
        CountRecord(
            START_S + 10.0 * (i + 1), x + dx, y + dy, 30.0, int(rng.poisson(cps * 9.5)), 10.0, 9.5, 10 / 9.5
        )
        for i, ((x, y), (dx, dy), cps) in enumerate(
            zip(places, noise.tolist(), rate.tolist(), strict=True), start=1
        )
    ]


def drive(start: tuple[float, float], end: tuple[float, float], count: int) -> list[tuple[float, float]]:
    return [tuple(place) for place in np.linspace(start, end, count).tolist()]


class _Recorded(mission_simulator._Simulation):
    """A simulated mission that keeps the events that its nodes would publish."""

    def __init__(self, settings: MissionSettings) -> None:
        super().__init__(settings)
        self.events: list[Event] = []

    def carry_out(self, robot: mission_simulator._Robot, action: Action) -> None:
        if isinstance(action, Publish):
            status = robot.mission.status
            self.events.append(replace(status, now_s=status.now_s + START_S))
        elif isinstance(action, RequestPlan) and self.channels[0].records:
            self.events.append(None)  # the map is updated
        super().carry_out(robot, action)

    def record(self, robot: mission_simulator._Robot) -> CountRecord:
        record = super().record(robot)
        self.events.append(replace(record, stamp_s=record.stamp_s + START_S))
        return record


def mission(seed: int = 1) -> tuple[list[Event], MissionResult]:
    settings = MissionSettings(
        field=FIELD, hours=0.3, seed=seed, dwell="fmi:60", cell_m=CELL_M, map_from="records", model="matern32",
        fit="reml", noise="local", preset="paper",
    )  # fmt: skip
    simulation = _Recorded(settings)
    result = simulation.run(lambda share: None)
    return simulation.events, result


def one_stop(run: Path) -> None:
    """A robot that stands still, without a mission; the recorder ended after the mapper."""
    many = records([(30.0, 20.0)] * 14)
    write_bag(run, [*many[:12], None, *many[12:]])


def drive_and_stop(run: Path) -> None:
    write_bag(run, mission()[0])


def no_position_gap(run: Path) -> None:
    """A drive during which the receiver loses the fix for a while, and once reports a wrong place."""
    places = drive((5, 5), (55, 40), 30)
    places[10:14] = [(NAN, NAN)] * 4
    places[20] = (4000.0, 40.0)
    write_bag(run, [*records(places), None])


def was_reset(run: Path) -> None:
    """The map is reset between two drives: the last map on line has only the second drive."""
    many = records([*drive((5, 5), (55, 5), 12), *drive((55, 40), (5, 40), 12)])
    configure(run)
    with BagWriter(run / "bag") as writer:
        robot = Robot(writer, run)
        for number, event in enumerate(many):
            if number == 12:
                robot.publish(None)
                robot.online.reset()
            robot.publish(event)
        robot.publish(None)


def raw_lines(run: Path) -> None:
    field = surrogate_field(FIELD)
    stops = np.array([(10.0, 10.0), (40.0, 12.0), (35.0, 30.0)])
    log = simulate_log(field, stop_and_go(stops, 60.0), np.random.default_rng(3))
    configure(run)
    name = run / "log"
    lines = [line for text in log.logger_lines for line in text.split("\n")]
    logger = parse_log([line.encode() for line in lines], "thorvald_crs", "signed", name)
    fixes, _ = parse_nmea([line.encode() for line in log.nmea_lines], name)
    site = open_survey(str(run / "configuration" / "field.yaml"), str(run / "configuration" / "site.yaml")).site
    survey = process_logs([logger], site, field.frame, Track(fixes))
    with BagWriter(run / "bag") as writer:
        robot = Robot(writer, run)
        for line in lines:
            robot.publish(("raw/logger", line))
        for line in log.nmea_lines:
            robot.publish(("raw/gnss", line))
        for record in survey.records:
            robot.publish(record)
        robot.publish(None)


def two_robots(run: Path) -> None:
    configure(run)
    with BagWriter(run / "bag") as writer:
        first, second = Robot(writer, run, "/robot1"), Robot(writer, run, "/robot2")
        for event in records(drive((5, 5), (30, 40), 16)):
            first.publish(event)
        first.publish(None)
        for event in mission(seed=2)[0]:
            second.publish(event)


CASES: dict[str, Callable[[Path], None]] = {
    make.__name__: make for make in (one_stop, drive_and_stop, no_position_gap, was_reset, raw_lines, two_robots)
}


def summary(run: MapRun, as_on_line: bool | None) -> dict[str, Any]:
    soil_map, mission = run.soil_map, run.mission
    found: dict[str, Any] = {
        "records": len(run.track),
        "samples": len(soil_map.samples),
        "raw_counts": float(soil_map.samples.counts.sum()),
        "lost": {row.kind: row.count for row in run.losses},
        "as_on_line": as_on_line,
        "bands": {
            name: [float(f(getattr(soil_map, name))) for f in (np.nanmin, np.nanmean, np.nanmax)]
            for name in ("rate", "rate_sd", "vwc", "vwc_sd")
        },
    }
    if mission is not None:
        found["mission"] = {
            "ended": mission.ended,
            "distance_m": mission.series[-1].distance_m,
            "visits": [[v.name, v.arrived_s, v.dwell_s, v.raw_counts] for v in mission.visits],
        }
    return found


OPTIONS: dict[str, dict[str, dict[str, Any]]] = {
    "raw_lines": {"counts": {}},
    "two_robots": {"robot1": {"counts_topic": "/robot1/counts"}, "robot2": {"counts_topic": "/robot2/counts"}},
}
"""Settings of the replays of a case by name; other cases are replayed with the defaults."""


def expected(run: Path) -> dict[str, Any]:
    found = {}
    for name, settings in OPTIONS.get(run.name, {"replay": {}}).items():
        replay = replay_bag(run, ReplaySettings(**settings))
        text = replay.comparisons[0]
        same = None if text.startswith("not compared") else "bit for bit" in text
        found[name] = summary(replay.run, same)
    if run.name == "raw_lines":
        files = {name: run / "configuration" / f"{name}.yaml" for name in ("field", "site")}
        found["raw"] = summary(
            map_logs([run], MapSettings(**files, cell_m=4.0, noise="local", drift_model="off")), None
        )
    return found


def main() -> None:
    """Write all cases, or the cases named on the command line."""
    for name in sys.argv[1:] or CASES:
        run = HERE / name
        shutil.rmtree(run, ignore_errors=True)
        CASES[name](run)
        (run / "expected.json").write_text(json.dumps(expected(run), indent=1) + "\n")
        size = sum(path.stat().st_size for path in run.rglob("*") if path.is_file())
        print(f"{name}: {size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
