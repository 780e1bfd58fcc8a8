# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Real inputs of the readers that are fuzzed."""

from __future__ import annotations

import io
import json
import tempfile
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path

import numpy as np

from soilmoist_ros.exploration import EVENT, Choice, Mission, MissionRules, Stop, Verb, parse_dwell
from soilmoist_ros.exploration.mission.events import Command, GoalReached, Moved, Planned, RecordArrived, Tick
from soilmoist_ros.exploration.mission.state import event_from_dict, event_to_dict
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.recording.journal import ENTRIES, Journal
from soilmoist_ros.sensing.records import CountRecord

ROOT = Path(__file__).resolve().parents[2]
SQUARE = [[5.0, 52.0], [5.001, 52.0], [5.001, 52.001], [5.0, 52.001], [5.0, 52.0]]


def shipped(pattern: str, limit: int = 60_000) -> Callable[[], list[bytes]]:
    """Files of the repository, cut to a size [bytes]."""
    return lambda: [path.read_bytes()[:limit] for path in sorted(ROOT.glob(pattern))]


def texts(*contents: object) -> Callable[[], list[bytes]]:
    return lambda: [(one if isinstance(one, str) else json.dumps(one)).encode() for one in contents]


@cache
def raster() -> bytes:
    from rasterio.io import MemoryFile
    from rasterio.transform import Affine

    with MemoryFile() as memory:
        with memory.open(
            driver="GTiff", width=12, height=9, count=2, dtype="float32", crs="EPSG:4326", nodata=-9999.0,
            transform=Affine(3e-4, 0.0, 4.999, 0.0, -3e-4, 52.002), compress="deflate",
        ) as file:  # fmt: skip
            file.write(np.arange(1, 217, dtype="float32").reshape(2, 9, 12))
        return bytes(memory.read())


def logs() -> list[bytes]:
    return [
        log
        for pattern in ("examples/*.KSU", "examples/*.dat", "test/data/*.csv")
        for log in shipped(pattern, 5000)()
    ]


def live_lines() -> list[bytes]:
    """What a simulated robot sends in two minutes."""
    from soilmoist_ros.simulation.mission.settings import MissionSettings
    from soilmoist_ros.simulation.robot.simulated_links import Sent
    from soilmoist_ros.simulation.system import VirtualSystem

    outputs = VirtualSystem(MissionSettings(field="rough"), 1_780_000_000.0).advance(120.0)[0]
    return [b"".join(output.data for output in outputs if isinstance(output, Sent))]


def truths() -> list[bytes]:
    """Fields with a formula: others name a file."""
    return [text for text in shipped("config/fields/*.yaml")() if b"\n  formula:" in text]


def records() -> list[bytes]:
    return [run_files()["records.csv"]]


def events() -> list[dict[str, object]]:
    record = CountRecord(1_780_000_000.0, 12.0, 8.0, 0.0, 30, 10.0, 9.5, 1.02, 1.03, 1.0)
    choice = Choice(Stop("s", 12.0, 8.0), "far", dwell=parse_dwell("fmi:60"))
    return [
        event_to_dict(event)
        for event in (
            Command(0.0, Verb.START), Planned(1.0, 1, choice, 20.0), Moved(2.0, 3.0, 4.0),
            GoalReached(20.0, 1, 12.0, 8.0), *(RecordArrived(30.0 + 10 * number, record) for number in range(6)),
            Command(95.0, Verb.RULE_OUT, polygon=((0.0, 0.0), (9.0, 0.0), (9.0, 9.0))), Tick(100.0),
        )
    ]  # fmt: skip


def event_lines() -> list[bytes]:
    return ["\n".join(map(json.dumps, events())).encode()]


def mission_state() -> list[bytes]:
    mission = Mission(MissionRules(budget_s=3600.0, dwell=parse_dwell("fmi:60")))
    for event in events():
        mission.step(event_from_dict(dict(event)))
    return [mission.snapshot().encode()]


def journal() -> list[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        with Journal.open(Path(folder)) as written:
            for event in events():
                written.append(EVENT, event)
        return [Path(folder, ENTRIES).read_bytes()]


def points() -> list[bytes]:
    rows = [f"{x},{y},{2 + 0.01 * x}" for y in range(0, 60, 10) for x in range(0, 70, 10)]
    return ["\n".join(["x_m,y_m,rate_cps", *rows, ""]).encode()]


@cache
def plain_bags() -> list[bytes]:
    """Golden bags without compression and checksums, so that changes reach their messages."""
    from mcap.reader import make_reader
    from mcap.writer import CompressionType, Writer

    bags = []
    for path in sorted(ROOT.glob("test/golden/*/bag/*.mcap")):
        stream = io.BytesIO()
        writer = Writer(stream, compression=CompressionType.NONE, use_chunking=False, enable_crcs=False)
        writer.start("ros2")
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        with path.open("rb") as file:
            for schema, channel, message in make_reader(file).iter_messages():
                assert schema is not None
                if schema.id not in schemas:
                    schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
                if channel.id not in channels:
                    channels[channel.id] = writer.register_channel(
                        channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata
                    )
                writer.add_message(
                    channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
                )
        writer.finish()
        bags.append(stream.getvalue())
    return bags


@cache
def run_files() -> dict[str, bytes]:
    """Output of a short mission, and the file of the mission in a campaign."""
    from soilmoist_ros.lab.mission_store import pack
    from soilmoist_ros.reporting import write_mission
    from soilmoist_ros.simulation import MissionSettings, simulate_mission

    settings = MissionSettings(hours=0.3, cell_m=8.0, dwell="fmi:60", preset="paper")
    result = simulate_mission(settings)
    with tempfile.TemporaryDirectory() as folder:
        write_mission(Path(folder), result)
        files = {path.name: path.read_bytes() for path in Path(folder).iterdir() if path.is_file()}
    return {**files, "mission.npz": pack(result, "0" * 16)}


def topic(name: str) -> Callable[[], list[bytes]]:
    """The last message of a topic in each golden bag: its text, or its values as lines KEY=VALUE."""

    def found() -> list[bytes]:
        texts = []
        for path in sorted(ROOT.glob("test/golden/*/bag")):
            with BagReader(path) as reader:
                wanted = [message for message in reader.messages() if message.topic.endswith(f"/{name}")]
                for message in wanted[-1:]:
                    content = reader.decode(message)
                    values = getattr(content, "values", ())
                    texts.append("\n".join(f"{one.key}={one.value}" for one in values) if values else content.data)
        return [text.encode() for text in texts]

    return found


def travel_map() -> list[bytes]:
    from soilmoist_ros.cli.main import main

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "map.json")
        with redirect_stdout(io.StringIO()):
            main(["graph", "smooth", "--out", str(file)], standalone_mode=False)
        return [file.read_bytes()]


def model() -> list[bytes]:
    """Text of the topic ``model``: a variogram with a rate that differs from place to place."""
    from msg_adapters.model import Model, model_to_message
    from soilmoist_ros.mapping.variogram.fit import estimate_variogram

    rng = np.random.default_rng(1)
    xy = rng.uniform(0, 50, (9, 2))
    fit = estimate_variogram(xy, rng.poisson(400, 9), np.full(9, 100.0), local_noise=True)
    return [model_to_message(one).data.encode() for one in (Model(fit, 1.0, 2.0), Model(None, 1.0, 2.0))]


GEOJSON = {
    "type": "FeatureCollection",
    "features": [{"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [SQUARE]}}],
}
CAMPAIGN = """title: a title
runs: 3
defaults: {hours: 2, cell_m: 2}
experiments:
  - {name: one, field: [smooth, rough], strategy: gcb, dwell: optimal}
  - {name: two, strategy: lattice, dwell: ["fmi:10", "ami:0.03"]}
"""
SHAPES = {
    "type": "FeatureCollection",
    "features": [
        {"type": "Feature", "properties": {"kind": kind}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
        for kind, ring in (("clay", [[x + 4e-4, y] for x, y in SQUARE]), ("sand", SQUARE))
    ],
}
DRAWN = {
    "name": "drawn",
    "datum": [52.0, 5.0],
    "boundary": [[0, 0], [60, 0], [60, 50], [0, 50]],
    "no_go": [[[10, 10], [20, 10], [20, 20]]],
    "places": [[0, 0], [60, 0], [60, 50], [0, 50], [0, 1]],
    "sd": 0.5,
}
FIELD = """name: f
datum: {latitude_deg: 52.0, longitude_deg: 5.0}
polygon: [[0, 0], [60, 0], [60, 50], [0, 50]]
no_go: [[[10, 10], [20, 10], [20, 20]]]
"""
