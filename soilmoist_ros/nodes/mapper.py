# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Merges records to samples, fits the variogram, and maps rate and moisture with their uncertainty."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from std_srvs.srv import Trigger

from msg_adapters import (
    Model,
    OtherFrameError,
    counts_from_message,
    diagnostics_to_message,
    model_to_message,
    require_plane,
    samples_to_message,
    soil_map_to_message,
    uncertainty_to_message,
)
from soilmoist_ros.foundation import Batches, Health, InputError, Level
from soilmoist_ros.mapping import MapState, MapWorker, Skip, SoilMap, map_health
from soilmoist_ros.nodes.node_process import Aside, run
from soilmoist_ros.nodes.parameter_tables import MAPPER as PARAMETERS
from soilmoist_ros.nodes.parameter_tables import STAMP_LIMITS, stamp_limits
from soilmoist_ros.nodes.parameters import Parameters, Value, other_namespaces
from soilmoist_ros.nodes.topics import DEFAULT, LATCHED, RECORDS, VISITS, every, interface_class, ros_now_s
from soilmoist_ros.pipeline import open_survey
from soilmoist_ros.recording import START, TEAM_S, MapRecords, MapSources, quarantined_topic, read_earlier
from soilmoist_ros.sensing import DOUBTS, CountRecord, Doubt

__all__ = ["PARAMETERS", "Mapper", "main"]

_POLL_S: Final = 1.0
_FLUSH_S: Final = 5.0
_SLICE: Final = 500  # records that are added at a time, so that reports and services need not wait for a flood


class Mapper(Node):
    """Adds records as they arrive, and publishes maps as fast as they can be computed.

    Records are added in one thread, maps are computed in another, and a third one saves.
    """

    def __init__(self) -> None:
        super().__init__("mapper")
        parameters = self._values = Parameters(self, PARAMETERS)
        self._frame = parameters.text("frame")
        self._save_dir = Path(parameters.text("save_dir")).expanduser().absolute()
        options: dict[str, Any] = parameters.as_dict()
        options["property_name"] = Path(parameters.text("start_property")).name
        self._stamps = stamp_limits(parameters)
        self._stored_stamps = replace(self._stamps, max_age_s=0.0)
        for name in ("frame", "save_dir", "start_from", "start_property", "others", "record_dir"):
            del options[name]
        for row in STAMP_LIMITS:
            del options[row.name]
        self._options = options
        self._survey = open_survey(**options)
        self._online = self._survey.map
        self._choices: dict[str, dict[str, Any]] = {}
        self._chosen: dict[str, Any] = {}
        self._refused = ""
        self._guard = threading.Lock()  # records are added in one thread and saved in another
        self._samples = self.create_publisher(PointCloud2, "samples", LATCHED)
        self._model = self.create_publisher(String, "model", LATCHED)
        self._soil_map = self.create_publisher(PointCloud2, "soil_map", LATCHED)
        self._uncertainty = self.create_publisher(OccupancyGrid, "uncertainty", LATCHED)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", DEFAULT)
        self._worker = MapWorker(self._online.compute, self._publish)
        # The planner needs the cell size before the first map.
        self._model.publish(model_to_message(Model(None, 0.0, self._online.grid.cell_m)))
        others = other_namespaces(self, parameters.texts("others"))
        self._several = bool(others)
        self._records = MapRecords(self._online, TEAM_S if others else 0.0)
        topics = [self.resolve_topic_name(topic) for topic in ("counts", *(f"{name}/counts" for name in others))]
        folder, named = parameters.text("record_dir"), parameters.text("start_property")
        self._sources = MapSources(
            self._records, Path(folder).expanduser() if folder else None, self._frame, self._fault
        )
        if earlier := parameters.text("start_from"):
            self._records.take(START, read_earlier(Path(earlier).expanduser(), named))
        self._arrived = Batches(self._add, "records", _POLL_S)
        for robot, topic in zip(("", *others), topics, strict=True):
            for name in (topic, quarantined_topic(topic)):
                self.create_subscription(PointCloud2, name, partial(self._put, robot), RECORDS)
        self._aside = Aside(self)  # a save takes seconds
        self._aside.offer(Trigger, "~/reset", self._on_reset)
        self._aside.offer(Trigger, "~/save", self._on_save)
        parameters.watch(self._on_parameters)
        above = [f"{self.get_namespace().removesuffix('/' + named.strip('/'))}/"] if named else []  # the planner's
        self._follow_planners(["", *(f"{name}/" for name in others), *above])
        for robot in ("", *others):
            below = f"{robot}/" if robot else above[0] if above else ""
            self.create_subscription(
                String, f"{below}{DOUBTS}", partial(self._put, robot if others else None), VISITS
            )
        every(self, 1.0, self._report)

    # What an operator chooses -----------------------------------------------------------------------------------

    def _follow_planners(self, below: Sequence[str]) -> None:
        """Use the field, earlier runs and covariates that an operator chooses at a planner."""
        try:
            kind = interface_class("soilmoist_msgs/msg/Mission")
        except ImportError:
            return
        for robot in below:
            self.create_subscription(kind, f"{robot}mission_state", partial(self._on_mission, robot), LATCHED)

    def _on_mission(self, robot: str, message: Any) -> None:
        from msg_adapters import survey_from_message

        chosen = survey_from_message(message)
        if chosen != self._choices.get(robot, {}):
            self._choices[robot] = chosen
            self._aside.do(partial(self._choose, chosen), "using another field")

    def _choose(self, chosen: dict[str, Any]) -> None:
        if chosen == self._chosen and not self._refused:  # at the planner of another robot
            return
        try:
            survey = open_survey(**(self._options | chosen))
        except InputError as error:
            self._refused = f"the map is still of {self._survey.field.name}: {error}"
            self.get_logger().error(self._refused)
            return
        self._refused, self._chosen = "", chosen
        self._worker.close()
        with self._guard:
            self._survey, self._online = survey, survey.map
            self._records.use(self._online)
            self._worker = MapWorker(self._online.compute, self._publish)
            state = self._online.state
        self._model.publish(model_to_message(Model(None, 0.0, self._online.grid.cell_m)))
        self._worker.submit(state)
        self.get_logger().info(f"the map is of {survey.field.name} now, with {state.records} records")
        names = ("field", "earlier", "covariates")
        self._values.show({name: (self._options | chosen)[name] for name in names})

    def _on_parameters(self, values: Mapping[str, Value]) -> str:
        """Only the planner changes them."""
        now = self._options | self._chosen
        other = [name for name, value in values.items() if value != now[name]]
        return f"set {', '.join(other)} of the planner: the mapper follows" if other else ""

    # Records and maps -------------------------------------------------------------------------------------------

    def _put(self, robot: str | None, message: PointCloud2 | String) -> None:
        self._arrived.put((robot, message))

    def _add(self, messages: Sequence[tuple[str | None, PointCloud2 | String]]) -> None:
        """Add the records of messages, and what is new on the disk; called once a second without messages."""
        records: list[CountRecord] = []
        doubts: list[tuple[Doubt, str | None]] = []
        for robot, message in messages:
            if isinstance(message, String):
                try:
                    doubts.append((Doubt.from_text(message.data), robot))
                except ValueError as error:
                    self._skip(Skip.UNREADABLE, error)
                continue
            found = self._decoded(message)
            if self._several:
                self._records.sent_by(robot or "", found)
            for record in found:
                if fault := self._fault(record):
                    self._skip(Skip.STAMP, fault)
                else:
                    records.append(record)
        for start in range(0, max(len(records), 1), _SLICE):
            with self._guard:
                self._sources.received(records[start : start + _SLICE])
        with self._guard:
            for doubt, robot in doubts:
                self._records.doubt(doubt, robot)
            if messages or self._online.state.records:
                self._worker.submit(self._online.state)

    def _decoded(self, message: PointCloud2) -> Sequence[CountRecord]:
        """Records of a message; none of one that cannot be used, which is reported."""
        try:
            found = counts_from_message(message)
            require_plane(message, self._frame, self._survey.field.frame)
        except ValueError as error:
            self._skip(Skip.OTHER_FRAME if isinstance(error, OtherFrameError) else Skip.UNREADABLE, error)
            return ()
        return found

    def _fault(self, record: CountRecord, stored: bool = False) -> str:
        """Reason why the stamp of a record is impossible; what was stored before the start may be of any age."""
        limits = self._stored_stamps if stored else self._stamps
        return limits.fault(record.stamp_s, ros_now_s(self))

    def _skip(self, reason: Skip, why: object) -> None:
        with self._guard:
            self._online.skip(reason, str(why))

    def _publish(self, state: MapState, soil_map: SoilMap | None) -> None:
        grid, stamp_s, frame = self._online.grid, state.stamp_s, self._frame
        fit, changing = (None, None) if soil_map is None else (soil_map.fit, state.changing(soil_map))
        self._samples.publish(samples_to_message(state.mapped_samples(soil_map), stamp_s, frame))
        basis = self._survey.dose_basis(state)
        self._model.publish(model_to_message(Model(fit, stamp_s, grid.cell_m, changing, basis)))
        self._soil_map.publish(soil_map_to_message(grid, soil_map, stamp_s, frame))
        self._uncertainty.publish(uncertainty_to_message(grid, soil_map, stamp_s, frame))

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._guard:
            records = self._online.state.records
            self._sources.reset()
            self._worker.submit(self._online.state)
        response.success, response.message = True, f"{records} records removed"
        return response

    def _on_save(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        from soilmoist_ros.reporting import write_outputs  # 5 MB that a robot needs only here

        self._arrived.flush(_FLUSH_S)  # the last records of a mission may still wait
        with self._guard:
            snapshot = self._online.snapshot()
        try:
            write_outputs(self._save_dir, self._survey.run(snapshot))
        except Exception as error:  # the caller gets an answer even if the disk is full
            self.get_logger().error(f"saving failed: {error}")
            response.success, response.message = False, f"nothing is saved: {error}"
        else:
            response.success, response.message = True, str(self._save_dir)
        return response

    def _report(self) -> None:
        now_s = ros_now_s(self)
        with self._guard:
            parts = [map_health(self._online, self._worker, now_s), *self._survey.health(self._online.state)]
        lost = f"{self._arrived.lost} messages with counts came too fast" if self._arrived.lost else ""
        counts = self.resolve_topic_name("counts") if self._several and self.count_publishers("counts") > 1 else ""
        twice = f"several nodes publish {counts}: give each robot its own namespace" if counts else ""
        faults = {"records": self._sources.problem, "field": self._refused, "messages": lost, "others": twice}
        parts += [Health(name, Level.ERROR, fault) for name, fault in faults.items() if fault]
        self._diagnostics.publish(diagnostics_to_message(parts, now_s, self.get_fully_qualified_name()))

    def close(self) -> None:
        """Add what has arrived, and wait until the current map and the files are finished."""
        self._aside.close()
        self._arrived.close()
        self._worker.close()
        self._sources.close()


def main() -> None:
    """Run the node."""
    run(Mapper)


if __name__ == "__main__":
    main()
