# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Readers of bytes that may come from anywhere, with real files to begin from, and a simple mutator.

A reader may refuse its input by an error of the package, or by ``ValueError`` where its documentation says so.
Everything else is a fault: another exception, more than :data:`LIMIT_S` of processor time, memory beyond the
caller's limit.
"""

from __future__ import annotations

import base64
import random
import re
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FrameType

from fuzz_seeds import (
    CAMPAIGN,
    DRAWN,
    FIELD,
    GEOJSON,
    SHAPES,
    event_lines,
    journal,
    live_lines,
    logs,
    mission_state,
    model,
    plain_bags,
    points,
    raster,
    records,
    run_files,
    shipped,
    texts,
    topic,
    travel_map,
    truths,
)

from soilmoist_ros.console.plan_work import TASKS, outline
from soilmoist_ros.console.server import request_from_json
from soilmoist_ros.exploration import MissionRules, parse_dwell, parse_topological_map, state_from_json
from soilmoist_ros.exploration.mission.journal import EVENT, interrupted_mission, is_under_way
from soilmoist_ros.foundation import LocalFrame, SoilmoistError, read_json
from soilmoist_ros.lab.campaign_file import load_campaign
from soilmoist_ros.lab.mission_store import UnusableMissionError, unpack
from soilmoist_ros.mapping import CovariateSource, FieldGrid, load_field, read_covariates
from soilmoist_ros.pipeline import ReplaySettings, read_run, replay_bag
from soilmoist_ros.recording import BagReader, bag_info, load_journal, read_records, recover_bag
from soilmoist_ros.reporting.opened_run import open_run
from soilmoist_ros.sensing import Site, load_site, parse_log, parse_nmea, read_log, read_soil_cores
from soilmoist_ros.sensing.corrections.intensity import read_neutron_monitor
from soilmoist_ros.sensing.formats.logger_format import LoggerFormat, load_logger_format, logger_names
from soilmoist_ros.sensing.survey.stream import SensorStream
from soilmoist_ros.simulation import load_scenario, load_surrogate

LIMIT_S = 20.0
RULES = MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:60"))
FRAME = LocalFrame(52.0, 5.0)


@dataclass(frozen=True)
class Target:
    """A reader.

    :param read: reads a path or bytes
    :param seeds: makes real inputs
    :param name: name of the file that ``read`` gets; empty if it takes bytes
    :param refusals: errors by which it refuses its input
    """

    read: Callable[..., object]
    seeds: Callable[[], list[bytes]]
    name: str = ""
    refusals: tuple[type[Exception], ...] = (SoilmoistError,)

    def __call__(self, data: bytes) -> bool:
        """Whether an input is read, and not refused; raises what is a fault."""
        with (
            time_limit(),
            tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder,
        ):
            given: object = data
            if self.name:
                given = Path(folder, self.name)
                given.parent.mkdir(exist_ok=True)
                given.write_bytes(data)
            try:
                self.read(given)
            except self.refusals:
                return False
            return True


@contextmanager
def time_limit() -> Iterator[None]:
    """Raise ``TimeoutError`` in what takes too much processor time: a busy machine makes no fault."""

    def alarm(_signal: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"takes more than {LIMIT_S:g} s of processor time")

    before = signal.signal(signal.SIGPROF, alarm)
    signal.setitimer(signal.ITIMER_PROF, LIMIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@cache
def logger_format(name: str) -> LoggerFormat:
    """A format, read once: its file is another target."""
    return load_logger_format(name)


def read_logger(path: Path) -> None:
    """A log, by its format as it is found, and by each format that is given."""
    lines = path.read_bytes().splitlines()
    for logger in logger_names():
        with suppress(SoilmoistError):
            parse_log(lines, logger_format(logger), "signed", path)
    with suppress(SoilmoistError):
        read_log(path)


def read_live(data: bytes) -> None:
    stream = SensorStream(Site(), FRAME, "thorvald_crs")
    for number, line in enumerate(data.splitlines()[:400]):
        stream.take_logger_line(line, float(number))
        stream.take_nmea_line(line)
        stream.take_ready(float(number))
    stream.take_ready(1e9)


def read_bag(path: Path) -> None:
    bag_info(path)
    try:
        with BagReader(path) as reader:
            for message in reader.messages():
                with suppress(SoilmoistError):
                    reader.decode(message)
    finally:
        recover_bag(path, path.parent / "recovered")


def read_journal(path: Path) -> None:
    found = load_journal(path.parent)
    events = [entry.payload for entry in found.entries if entry.kind == EVENT]
    interrupted_mission(RULES, found.snapshot, events)


def read_events(data: bytes) -> None:
    """Events of a journal whose checksums are right: the mission, and whether it is continued."""
    read = [read_json(line) for line in data.splitlines()]
    found = [one for one in read if isinstance(one, dict)]  # as an entry of a journal is
    interrupted_mission(RULES, None, found)
    is_under_way(None, found)


def read_raster(path: Path) -> None:
    grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], cell_m=10.0)
    read_covariates([CovariateSource.parse(str(path))], FRAME, grid)


def read_vectors(path: Path) -> None:
    grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], cell_m=10.0)
    read_covariates([CovariateSource.parse(f"{path}:kind")], FRAME, grid)


def read_truth(kind: str) -> Callable[[Path], object]:
    def read(path: Path) -> None:
        field = path.parent / "truth.yaml"
        field.write_text(f"{FIELD}truth: {{{kind}: {path.name}}}\n")
        load_surrogate(field)

    return read


def read_replay(path: Path) -> None:
    """Map a recording again, in a field that is given."""
    field = path.parent / "field.yaml"
    field.write_text(FIELD)
    several = b"/robot1/counts" in path.read_bytes()
    topic = "/robot1/counts" if several else "counts"
    replay_bag(path, ReplaySettings(field=str(field), cell_m=10.0, counts_topic=topic))


def read_output(name: str) -> Callable[[Path], object]:
    """The output folder of a run, one file of which is given: as an earlier survey, and by the Python API."""

    def read(path: Path) -> None:
        for other in ("summary.json", "records.csv", "samples.geojson", "series.csv", "visits.csv", "map.tif"):
            if other != name:
                (path.parent / other).write_bytes(run_files()[other])
        with suppress(SoilmoistError):
            read_run(path.parent)
        run = open_run(path.parent)
        for part in (run.samples, run.records, run.bands):
            with suppress(SoilmoistError):
                part()
        assert repr(run)
        for table in ("series", "visits"):
            with suppress(SoilmoistError):
                getattr(run, table)

    return read


def output(name: str) -> Target:
    return Target(read_output(name), lambda: [run_files()[name]], f"run/{name}")


def read_model(data: bytes) -> None:
    from std_msgs.msg import String

    from msg_adapters.model import model_from_message

    model_from_message(String(data=data.decode(errors="replace")))


def read_status(data: bytes) -> None:
    from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

    from msg_adapters.mission import mission_from_message

    pairs = [line.partition("=") for line in data.decode(errors="replace").splitlines()]
    mission_from_message(DiagnosticStatus(values=[KeyValue(key=key, value=value) for key, _, value in pairs]))


def drawn_task(task: str) -> Target:
    """What somebody draws on the page: a field, its stops, or a walk around it."""
    return Target(lambda data: TASKS[task](read_json(data)), texts(DRAWN), refusals=WORK_REFUSALS)


def read_map(data: bytes) -> None:
    parse_topological_map(data.decode(errors="replace"))


def drawn(suffix: str) -> Callable[[bytes], object]:
    """Reads a boundary that somebody sends to the page."""
    return lambda data: outline(
        {"name": f"field{suffix}", "content": base64.b64encode(data).decode(), "datum": None}
    )


WORK_REFUSALS = (SoilmoistError, KeyError, TypeError, ValueError, OverflowError)
"""What the process refuses that draws fields."""


def read_geojson_field(path: Path) -> None:
    file = path.parent / "field.yaml"
    file.write_text(f"name: f\ngeojson: {path.name}\n")
    load_field(file)


def read_request(data: bytes) -> None:
    request_from_json(read_json(data), {"": None})


TARGETS = {
    "log": Target(read_logger, logs, "log.csv"),
    "live": Target(read_live, live_lines),
    "nmea": Target(lambda path: parse_nmea(path.read_bytes().splitlines(), path), live_lines, "gnss.txt"),
    "field": Target(load_field, texts(FIELD), "field.yaml"),
    "geojson": Target(read_geojson_field, texts(GEOJSON), "field.geojson"),
    "site": Target(load_site, shipped("config/sites/*.yaml"), "site.yaml"),
    "scenario": Target(lambda path: load_scenario(str(path)), shipped("config/scenarios/*.yaml"), "scenario.yaml"),
    "campaign": Target(load_campaign, texts(CAMPAIGN), "campaign.yaml"),
    "truth": Target(load_surrogate, truths, "truth.yaml"),
    "truth_points": Target(read_truth("points"), points, "truth.csv"),
    "truth_raster": Target(read_truth("grid"), lambda: [raster()], "truth.tif"),
    "logger_format": Target(load_logger_format, shipped("config/loggers/*.yaml"), "logger.yaml"),
    "bag": Target(read_bag, shipped("test/golden/*/bag/*.mcap", 100_000), "bag/bag_0.mcap"),
    "plain_bag": Target(read_bag, plain_bags, "bag/bag_0.mcap"),
    "replay": Target(read_replay, plain_bags, "bag/bag_0.mcap"),
    "journal": Target(read_journal, journal, "journal/entries.jsonl"),
    "summary": output("summary.json"),
    "samples": output("samples.geojson"),
    "visits": output("visits.csv"),
    "map": output("map.tif"),
    "stored_mission": Target(unpack, lambda: [run_files()["mission.npz"]], refusals=(UnusableMissionError,)),
    "records": Target(read_records, records, "records.csv"),
    "cores": Target(read_soil_cores, shipped("examples/*cores.csv"), "cores.csv"),
    "monitor": Target(
        read_neutron_monitor, texts("start_date_time;RCORR_E\n2021-10-01 00:00:00;101.5\n"), "monitor.txt"
    ),
    "raster": Target(read_raster, lambda: [raster()], "covariate.tif"),
    "vectors": Target(read_vectors, texts(SHAPES), "soil.geojson"),
    "topological_map": Target(read_map, travel_map),
    "mission": Target(lambda data: state_from_json(data.decode(errors="replace")), mission_state),
    "mission_events": Target(read_events, event_lines, refusals=(SoilmoistError, ValueError)),
    "request": Target(
        read_request, texts({"verb": "measure", "place": [1, 2]}), refusals=(SoilmoistError, ValueError)
    ),
    "drawn_geojson": Target(drawn(".geojson"), texts(GEOJSON)),
    "drawn_field": drawn_task("field"),
    "drawn_walk": drawn_task("walk"),
    # These need ROS: they are what nodes of others may publish.
    "model": Target(read_model, model, refusals=(ValueError,)),
    "status": Target(read_status, topic("mission"), refusals=(ValueError,)),
}

_TOKENS = (
    b"", b"\x00", b"\xff" * 8, b"nan", b"-inf", b"1e999", b"-1", b"9" * 400, b"{", b"[" * 3000, b'"', b"\r",
    b"\n" * 50, b"&a *a ", b"!!python/object:os.system ", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"null", b"true",
    b"0000", b"24:61:61",
)  # fmt: skip


_VALUE = re.compile(rb'"[^"\n]*"|-?\d+(\.\d+)?([eE][-+]?\d+)?|null|true|false')
_HOSTILE = (
    b"NaN", b"nan", b"inf", b"1e308", b"-1e308", b"1e-320", b"-1", b"0", b"-0.0", b"1e400", b"9" * 400, b"90",
    b"-180", b"null", b"true", b"[]", b"{}", b'""', b'"a"', b"[[]]", b"[null]", b'{"a": 1}',
    b"0001-01-01T00:00:00Z", b"9999-12-31T23:59:59Z", b"253402300800", b"4294967296", b"-9223372036854775809",
)  # fmt: skip


def other_value(data: bytes, rng: random.Random) -> bytes:
    """A text with one of its numbers or words replaced by another value: mostly a text of the same form."""
    found = list(_VALUE.finditer(data))
    if not found:
        return data
    one = rng.choice(found)
    value = rng.choice(_HOSTILE) if rng.random() < 0.7 else rng.choice(found).group()
    return data[: one.start()] + value + data[one.end() :]


def mutated(data: bytes, rng: random.Random) -> bytes:
    """An input with one to four changes: other values, or pieces that are dropped, repeated, moved or replaced."""
    if rng.random() < 0.4:
        for _ in range(rng.randint(1, 4)):
            data = other_value(data, rng)
        return data
    out = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        if not out:
            break
        at = rng.randrange(len(out))
        piece = slice(at, at + rng.choice((1, 2, 4, 30, 500)))
        match rng.randrange(7):
            case 0:
                out[at] ^= 1 << rng.randrange(8)
            case 1:
                out[at] = rng.randrange(256)
            case 2:
                del out[piece]
            case 3:
                out[at:at] = out[piece] * rng.choice((1, 2, 50))
            case 4:
                out[piece] = rng.choice(_TOKENS)
            case 5:
                to = rng.randrange(len(out))
                out[to:to] = out[piece]
            case _:
                del out[at:]
    return bytes(out)
