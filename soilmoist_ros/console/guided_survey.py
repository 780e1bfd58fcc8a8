# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""An adaptive survey by a person, in one process without ROS: devices, map, mission, recording and page.

The folder of a survey holds what a restart needs::

    OUT/records/   each record, on the disk before anything uses it
    OUT/journal/   the mission
    OUT/bag/       the recording, which ``soilmoist replay OUT`` maps again
"""

from __future__ import annotations

import logging
import math
import shutil
import time
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from soilmoist_ros.console.board import RobotHistory, VisitHistory
from soilmoist_ros.console.guide_page import SHOW_S, GuidePage
from soilmoist_ros.console.map_layers import MapLayers
from soilmoist_ros.console.views import field_view, graph_views, health_view, mission_view, place_views
from soilmoist_ros.exploration import (
    PERSON_ENTRY_M,
    AccessRules,
    ExplorerSettings,
    Finish,
    MissionClock,
    MissionControl,
    MissionJournal,
    MissionRules,
    MissionSetup,
    MissionStatus,
    OperatorRequest,
    Outside,
    PersonNavigator,
    Phase,
    Reply,
    ReplyCode,
    Stop,
    Verb,
    Visit,
    boot_id,
    check_time,
    parse_dwell,
    person_rules,
    person_watch,
    status_health,
    warm_up,
)
from soilmoist_ros.foundation import Health, InputError, LatLon, Level
from soilmoist_ros.mapping import (
    FIT_SETTINGS,
    Field,
    FieldGrid,
    MappingSettings,
    MapState,
    MapWorker,
    Placement,
    PositionSource,
    SoilMap,
    likely_cause,
    map_cells,
    map_health,
)
from soilmoist_ros.pipeline import open_survey, planning_curve, planning_thresholds
from soilmoist_ros.recording import (
    CLOUD,
    CONFIGURATION,
    DRIVER,
    FRAME,
    BagReader,
    BagRecorder,
    MapRecords,
    MapSources,
    PlainTopics,
    RecordLog,
    RunConfiguration,
    StoredMission,
    count_records,
    free_bytes,
    next_bag,
    record_key,
    recorder_health,
    recover_bag,
    sample_points,
)
from soilmoist_ros.sensing import DOUBTS, UNKNOWN_SENSOR, Batch, CountRecord, Doubt, Driver, DriverSettings
from soilmoist_ros.simulation import MissionSettings, mission_map

PAGE: Final = "the page"
LOW_DISK_BYTES: Final = 5e8
FAR_M: Final = 5e3
"""Distance from the field at which the field file is doubted, and nothing starts [m]."""
LIMIT_VWC, LIMIT_SHARE = 0.005, 0.1
"""Distance from the limits of the soil [m^3/m^3] at which a share of the cells makes the whole level doubtful."""

NO_LOGGER: Final = "the logger does not answer: check its power, its cable and the address"
_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class GuideSettings:
    """Settings of a guided survey.

    :param mission: strategy, dwell, hours and motion; its field is the field file
    :param autostart: whether the mission starts with the first position, instead of a start on the page
    """

    mission: MissionSettings
    devices: DriverSettings
    out: Path
    site: str = ""
    earlier: Sequence[Path] = ()
    covariates: Sequence[str] = ()
    autostart: bool = False

    @property
    def rules(self) -> MissionRules:
        """Rules of the mission."""
        mission = self.mission
        rules = MissionRules(
            budget_s=3600 * mission.hours, dwell=parse_dwell(str(mission.dwell)),
            warm_up_stops=warm_up(str(mission.strategy), mission.preset)[0],
            min_dwell_s=mission.min_dwell_s or mission.cadence_s,
            min_last_dwell_s=(mission.min_dwell_s or mission.cadence_s) + mission.cadence_s,
            speed_mps=mission.speed_mps, stop_overhead_s=mission.stop_overhead_s,
            stays=mission.preset == "recommended", until_sd=mission.until_sd, until_gain=mission.until_gain,
            until=mission.aim,
        )  # fmt: skip
        return person_rules(rules)


def elsewhere(field: Field, latlon: LatLon) -> str:
    """Doubt about a field that is far from a place [deg], with the likely cause; empty if it is near."""
    placement = Placement(field, np.array([latlon]))
    if placement.nearest_m <= FAR_M:
        return ""
    swapped = likely_cause(placement, FAR_M, PositionSource()).startswith("swap")
    why = "latitude and longitude may be swapped" if swapped else "check the field file"
    return f"you are {placement.nearest_m / 1000:.0f} km from the field; {why}"


class GuidedSurvey:
    """A survey that runs in :meth:`run`, and is shown on a page.

    :raises InputError: if a file or an address cannot be used, or another process works in the folder
    """

    def __init__(self, settings: GuideSettings, page: GuidePage) -> None:
        self._settings, mission, out = settings, settings.mission, settings.out
        self._page, self.board, devices = page, page.board, settings.devices
        mapping = {name: getattr(mission, name) for name in (*FIT_SETTINGS, "prior")} | {"cell_m": mission.cell_m}
        earlier = [str(path.expanduser().absolute()) for path in settings.earlier]
        covariates = list(settings.covariates)
        self._survey = survey = open_survey(
            mission.field_name, settings.site, earlier=earlier, covariates=covariates, **mapping
        )
        check_time(mission.certify, survey.map.grid.area_m2, mission.motion, settings.rules, mission.cadence_s)
        self._plane = survey.field.frame
        curve = planning_curve(survey.site, survey.field, mission.target == "vwc")
        self._driver = Driver(devices, survey.site, self._plane, page.receiver())
        self._driver.refuse_taken()
        self._faults: dict[str, str] = {}
        self._latlon: LatLon | None = None
        self._lacks = NO_LOGGER  # why a start makes no sense yet; empty if nothing is missing
        self.ended: Finish | None = None
        """End of the mission; ``None`` while it is not over."""
        self._maps: deque[tuple[MapState, SoilMap | None]] = deque()
        self._mapped: tuple[MapState, SoilMap] | None = None
        self._shown_s = -math.inf
        self._stored = StoredMission(out / "journal", settings.rules, "auto", 0.0)
        self._log = RecordLog(out / "records" / DRIVER, FRAME)
        self._records = MapRecords(survey.map)
        self._sources = MapSources(self._records, out / "records", FRAME)
        self._bag = GuideBag(out, self._records.in_order, (self._plane.latitude_deg, self._plane.longitude_deg))
        self._bag.configure(
            {
                "mapper": {
                    "field": mission.field_name, "site": settings.site, "frame": FRAME, "earlier": earlier,
                    "covariates": covariates, "simulated": False,
                    **{name: value or 0.0 if name.endswith("_m") else value
                       for name, value in MappingSettings(**mapping).values().items()},
                },
                "sensor_driver": {
                    "field": mission.field_name, "site": settings.site, "logger_uri": devices.logger_uri,
                    "logger_format": devices.logger_format, "gnss_uri": devices.gnss_uri,
                },
                "planner": {
                    "field": mission.field_name, "strategy": str(mission.strategy), "dwell": str(mission.dwell),
                    "hours": mission.hours, "seed": mission.seed, "target": mission.target,
                    "threshold": mission.threshold or "",
                    "graph": mission.graph or mission.travel, "lanes": mission.travel == "lanes",
                    "preset": mission.preset, "until_sd": mission.until_sd, "until_gain": mission.until_gain,
                    "certify": mission.certify, "until": mission.until, "navigator": "person",
                },
            }
        )  # fmt: skip
        explorer = ExplorerSettings(
            strategy=str(mission.strategy), preset=mission.preset, seed=mission.seed, motion=mission.motion,
            curve=curve if mission.of_moisture(curve is not None) else None, calibration=curve,
            knowledge=survey.map.knowledge,
            thresholds=planning_thresholds(mission.target, mission.threshold, survey.site, curve),
            certify=mission.certify,
            access=AccessRules(entry_m=PERSON_ENTRY_M, outside=Outside.WAY, lanes=mission.travel == "lanes"),
        )  # fmt: skip
        self._history, self._visits = RobotHistory(self.board, ""), VisitHistory(self.board)
        self._control: MissionControl = MissionControl(
            MissionSetup(field=survey.field, settings=explorer, rules=settings.rules),
            partial(PersonNavigator, may_count=lambda: self._control.may_count()), self,
            MissionJournal(self._stored.journal), clock=MissionClock(time.time, time.monotonic, boot_id()),
            watch=person_watch(), mission=self._stored.mission,
        )  # fmt: skip
        self._autostart = settings.autostart and self._stored.starts
        if self._stored.mission is not None:
            self._control.take_up(self._stored.mission, self._stored.resumes)
        self._control.fit(None, 0.0, cell_m=survey.map.grid.cell_m)
        on_graph, grid = mission.travel != "free", survey.map.grid
        graph = mission_map(survey.field, grid, mission.graph).graph if on_graph else None
        self._control.use_graph(graph)
        if graph is not None:
            nodes, edges = graph_views(graph.names, graph.xy, graph.edges)
            self.board.put("nodes", nodes)
            self.board.put("edges", edges)
        self._worker = MapWorker(survey.map.compute, self._on_map)
        self._worker.submit(survey.map.state)
        self.board.put("field", field_view(survey.field))

    # The loop ------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Guide until the mission ends or the page is stopped; then all is on the disk."""
        self._driver.start(self._page.wake.set)
        try:
            while not self._page.stopped and self.ended is None:
                self._page.take(self)
                self._step()
        finally:
            self.board.put("over", self._page.stopped)
            self._driver.stop()
            self._control.close()
            self._worker.close()
            self._take_maps()
            if self._mapped is not None:
                self._bag.map(*self._mapped, self._survey.map.grid)
            self._bag.close()
            self._sources.close()
            self._log.close()
            self._stored.close()

    @property
    def has_records(self) -> bool:
        """True if the map has a record."""
        return bool(self._survey.map.state.records)

    def show_report(self, report: Path) -> None:
        """Say on the page where the report is."""
        self.board.put("report", str(report.absolute()))

    def _step(self) -> None:
        now_s, control = time.time(), self._control
        batch = self._driver.step(now_s)
        self._take(batch)
        if batch.more:
            self._page.wake.set()
        self._take_maps()
        control.hand_on()
        control.tick()
        control.check()
        for doubt in control.doubts():
            self._doubt(doubt)
        if self._autostart and not control.missing() and not self._lacks:
            self._autostart = not control.command(Verb.START).accepted
        if time.monotonic() - self._shown_s >= SHOW_S:
            self._shown_s = time.monotonic()
            devices = self._driver.health(now_s)
            self._lacks = self._lacking(devices)
            control.show()
            parts = [*control.health(), *devices]
            parts += [map_health(self._survey.map, self._worker, now_s), self._bag.health()]
            self.board.put("health", health_view(parts))
            faults = {part.name: part.message for part in parts if part.level is Level.ERROR}
            for name in sorted(faults.keys() - self._faults.keys()):
                _log.warning("%s: %s", name, faults[name])
            self._faults = faults

    def _lacking(self, devices: Sequence[Health]) -> str:
        """Reason not to start yet: a logger without records, or a field elsewhere; empty if all is there."""
        levels = {part.name: part.level for part in devices}
        faults = [part.message for part in devices if part.name == "records" and part.level is Level.ERROR]
        if levels.get("logger link") is not Level.OK:
            return NO_LOGGER
        if faults or self._latlon is None:
            return "".join(faults)
        return elsewhere(self._survey.field, self._latlon)

    def _take(self, batch: Batch) -> None:
        """Store what the devices have sent, then use it."""
        for name, lines in (("/raw/logger", batch.logger_lines), ("/raw/gnss", batch.gnss_lines)):
            for line in lines:
                self._bag.put(*self._bag.topics.line(name, line))
        for fix in batch.fixes:
            self._bag.put(*self._bag.topics.fix(fix))
            self._control.hear(fix)
            position = fix.position
            self._latlon = position.latitude_deg, position.longitude_deg
            x_m, y_m = self._plane.to_local(position.latitude_deg, position.longitude_deg)[0].tolist()
            if math.isfinite(x_m) and math.isfinite(y_m):
                self._history.place(x_m, y_m, position.horizontal_sd_m)
                self._page.walk.place(x_m, y_m, position.horizontal_sd_m)
                self._control.fix((x_m, y_m), position.horizontal_sd_m, fix.stamp_s)
        made = [self._bag.topics.counts(record, self._bag.datum) for record in batch.records]
        records = [record for _, message in made for record in count_records(message)]
        if not records:
            return
        try:
            self._log.write(records)
        except OSError as error:  # a disk that fails does not stop the survey
            _log.error("records are not stored: %s", error.strerror or error)
        for topic, message in made:
            self._bag.put(topic, message)
        self._sources.received(records)
        self._worker.submit(self._survey.map.state)
        self._control.records(records)

    def _doubt(self, doubt: Doubt) -> None:
        self._driver.doubts.take(doubt)
        self._records.doubt(doubt)
        self._bag.put(*self._bag.topics.text(f"/{DOUBTS}", doubt.to_text()))

    def _on_map(self, state: MapState, soil_map: SoilMap | None) -> None:
        self._maps.append((state, soil_map))
        self._page.wake.set()

    def _take_maps(self) -> None:
        while self._maps:
            state, soil_map = self._maps.popleft()
            self._control.samples(state.mapped_samples(soil_map), state.stamp_s)
            self.board.put("samples", tuple(place_views(state.samples.xy)))
            if soil_map is None:
                continue
            self._mapped = state, soil_map
            self._control.fit(soil_map.fit, state.stamp_s, changing=state.changing(soil_map))
            self._page.picture = MapLayers.after(self._page.picture, map_cells(self._survey.map.grid, soil_map))
            self.board.put("map", self._page.picture.about)
            self.board.put("doubts", self._doubts(soil_map))
            self.board.hear("map")

    def _doubts(self, soil_map: SoilMap) -> list[str]:
        """Code of the reason why the level of the moisture is uncertain, for the page."""
        calibration, limits = self._survey.site.calibration, soil_map.limits
        if calibration is None or limits is None:
            return []
        guessed = calibration.illustrative or calibration.method == UNKNOWN_SENSOR or not calibration.has_origin
        vwc = soil_map.vwc[np.isfinite(soil_map.vwc)]
        cut = (vwc >= limits.saturation - LIMIT_VWC) | (vwc <= limits.dryness + LIMIT_VWC)
        found = {"unsure": guessed, "limit": bool(len(cut)) and float(cut.mean()) > LIMIT_SHARE}
        return [name for name, holds in found.items() if holds]

    # What the mission asks for (Outputs) ---------------------------------------------------------------------

    def now_s(self) -> float:
        """Time on the clock that stamps the records [s]."""
        return time.time()

    def show(self, status: MissionStatus, ahead: tuple[Stop, ...], more: Mapping[str, str]) -> None:
        """Show and record the mission."""
        if status.phase is Phase.IDLE and self._lacks and not self._control.missing():
            status = replace(status, reason=self._lacks)
        self.board.put("mission/", mission_view(status, more))
        self.board.put("plan/", place_views(stop.xy for stop in ahead))
        self._history.follow(status)
        self.board.hear("mission/")
        self._bag.put(*self._bag.topics.health("/mission", status_health(status, more)))

    def visit(self, visit: Visit) -> None:
        """A stop is complete."""
        self._visits.add((visit.x_m, visit.y_m))
        self._bag.put(*self._bag.topics.visit(visit))

    def finish(self, finish: Finish) -> None:
        """The mission has ended; outputs are written at the end of the process."""
        self.ended = finish
        self.board.put("report", "")

    def wake(self) -> None:
        """Plans are ready."""
        self._page.wake.set()

    # What the page asks for (Asked) --------------------------------------------------------------------------

    def answer(self, request: OperatorRequest) -> Reply:
        """Pass a request to the mission."""
        if request.verb == Verb.START and self._lacks and not self._control.under_way:
            return Reply(ReplyCode.REFUSED, f"not yet: {self._lacks}")
        return self._control.request(request)

    def emergency(self, pressed: bool) -> None:
        """Pause, or end the stop of anybody."""
        self._control.emergency(pressed, PAGE)


# The recording: bags in ``OUT/bag``, one for each process; the last one of a killed process is repaired ---------


class GuideBag:
    """Records messages, and repairs what an earlier process left.

    :param out: folder of the survey
    :param records: all records of the survey so far: what the last bag lacks of them comes into the next one
    :param datum: latitude and longitude of the datum of the field [deg]
    """

    def __init__(self, out: Path, records: Sequence[CountRecord], datum: tuple[float, float]) -> None:
        self.topics, self.datum = PlainTopics(), datum
        self._out, self._bags = out, out / "bag"
        self._stamp_ns = 0
        missing = self._repaired(records)
        self._recorder = BagRecorder(lambda: next_bag(self._bags, "", "jazzy"))
        self._recorder.start()
        for record in missing:
            self.put(*self.topics.counts(record, datum))

    def configure(self, nodes: Mapping[str, Mapping[str, Any]]) -> None:
        """Store the settings, and the files that they name, as a replay reads them."""
        (self._out / CONFIGURATION).mkdir(parents=True, exist_ok=True)
        configuration = RunConfiguration()
        for node, values in nodes.items():
            configuration.take(node, values)
        configuration.write(self._bags)

    def put(self, topic: Any, message: Any) -> None:
        """Record a message; the times of all messages increase, as their order is that of the map."""
        self._stamp_ns = max(self._stamp_ns + 1, time.time_ns())
        self._recorder.put(topic, self._stamp_ns, self._stamp_ns, self.topics.data(topic, message))

    def map(self, state: MapState, soil_map: SoilMap, grid: FieldGrid) -> None:
        """Record the last map, which a replay compares with its own."""
        samples = sample_points(state.mapped_samples(soil_map))
        for name, cloud in (("/samples", samples), ("/soil_map", map_cells(grid, soil_map))):
            self.put(self.topics.topic(name, CLOUD), self.topics.cloud(cloud, state.stamp_s))

    def health(self) -> Health:
        """State of the recording."""
        return recorder_health(self._recorder.state, free_bytes(self._bags), LOW_DISK_BYTES)

    def close(self) -> None:
        """Write what waits, and close the bag."""
        self._recorder.stop()

    def _repaired(self, records: Sequence[CountRecord]) -> list[CountRecord]:
        """Repair the bag of a process that was killed; returns the records that no bag has."""
        whole = self._out / "repaired"
        for done in [path.parent for path in whole.glob("*/metadata.yaml")]:  # it was killed in the repair
            shutil.rmtree(self._bags / done.name, ignore_errors=True)
            done.rename(self._bags / done.name)
        for bag in [path for path in self._bags.glob("*") if not (path / "metadata.yaml").is_file()]:
            shutil.rmtree(whole, ignore_errors=True)
            try:
                recover_bag(bag, whole / bag.name)
            except InputError as error:
                _log.warning("the recording %s has nothing that can be used: %s", bag, error)
                (self._out / "unusable").mkdir(exist_ok=True)
                bag.rename(self._out / "unusable" / f"{bag.name}_{time.time():.0f}")
                continue
            shutil.rmtree(bag)
            if (whole / bag.name).is_dir():
                (whole / bag.name).rename(self._bags / bag.name)
        shutil.rmtree(whole, ignore_errors=True)
        if not any(self._bags.glob("*/metadata.yaml")):
            return list(records)
        with BagReader(self._bags) as reader:
            had = (
                Counter(map(record_key, reader.read_counts())) if "/counts" in reader.topics else Counter[bytes]()
            )
        missing = []
        for record in records:
            key = record_key(record)
            had[key] -= 1
            if had[key] < 0:
                missing.append(record)
        return missing
