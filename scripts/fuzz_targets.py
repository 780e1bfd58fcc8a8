"""Readers of bytes that may come from anywhere, with real files to begin from, and a simple mutator.

A reader may refuse its input by an error of the package, or by ``ValueError`` where its documentation says so.
Everything else is a fault: another exception, more than :data:`LIMIT_S` of time, memory beyond the caller's limit.
"""

from __future__ import annotations

import base64
import json
import random
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FrameType

import numpy as np

from soilmoist_ros.console.plan.outline import outline
from soilmoist_ros.console.requests import request_from_json
from soilmoist_ros.exploration.mission.stored import state_from_json
from soilmoist_ros.exploration.travel.topological_map import parse_topological_map
from soilmoist_ros.foundation.errors import SoilmoistError
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.foundation.plain_values import read_json
from soilmoist_ros.mapping.covariates.reading import read_covariates
from soilmoist_ros.mapping.covariates.source import CovariateSource
from soilmoist_ros.mapping.field import load_field
from soilmoist_ros.mapping.grid import FieldGrid
from soilmoist_ros.recording.bag.info import bag_info
from soilmoist_ros.recording.bag.reader import BagReader
from soilmoist_ros.recording.bag.recovery import recover_bag
from soilmoist_ros.recording.journal import load_journal
from soilmoist_ros.recording.record_table import read_records
from soilmoist_ros.sensing.corrections.neutron_monitor import read_neutron_monitor
from soilmoist_ros.sensing.formats.logger_format import logger_names
from soilmoist_ros.sensing.formats.logger_reader import parse_log, read_log
from soilmoist_ros.sensing.moisture.cores import read_soil_cores
from soilmoist_ros.sensing.moisture.site import Site, load_site
from soilmoist_ros.sensing.position.nmea import parse_nmea
from soilmoist_ros.sensing.survey.stream import SensorStream
from soilmoist_ros.simulation.campaign.campaign_file import load_campaign
from soilmoist_ros.simulation.fields.truth_file import load_surrogate
from soilmoist_ros.simulation.robot.scenario import load_scenario

ROOT = Path(__file__).resolve().parent.parent
LIMIT_S = 20.0
FRAME = LocalFrame(52.0, 5.0)
SQUARE = [[5.0, 52.0], [5.001, 52.0], [5.001, 52.001], [5.0, 52.001], [5.0, 52.0]]


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

    def __call__(self, data: bytes) -> None:
        """Read; raises what is a fault."""
        with (
            time_limit(),
            tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder,
        ):
            given: object = data
            if self.name:
                given = Path(folder, self.name)
                given.parent.mkdir(exist_ok=True)
                given.write_bytes(data)
            with suppress(self.refusals):
                self.read(given)


@contextmanager
def time_limit() -> Iterator[None]:
    """Raise ``TimeoutError`` in what takes too long; does nothing outside of the main thread."""

    def alarm(_signal: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"takes longer than {LIMIT_S:g} s")

    before = signal.signal(signal.SIGALRM, alarm)
    signal.setitimer(signal.ITIMER_REAL, LIMIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def shipped(pattern: str, limit: int = 60_000) -> Callable[[], list[bytes]]:
    """Files of the repository, cut to a size [bytes]."""
    return lambda: [path.read_bytes()[:limit] for path in sorted(ROOT.glob(pattern))]


def texts(*contents: object) -> Callable[[], list[bytes]]:
    """JSON of values, or texts as they are."""
    return lambda: [(one if isinstance(one, str) else json.dumps(one)).encode() for one in contents]


@cache
def raster() -> bytes:
    """A small GeoTIFF."""
    from rasterio.io import MemoryFile
    from rasterio.transform import Affine

    with MemoryFile() as memory:
        with memory.open(
            driver="GTiff", width=12, height=9, count=2, dtype="float32", crs="EPSG:4326", nodata=-9999.0,
            transform=Affine(3e-4, 0.0, 4.999, 0.0, -3e-4, 52.002), compress="deflate",
        ) as file:  # fmt: skip
            file.write(np.arange(216, dtype="float32").reshape(2, 9, 12))
        return bytes(memory.read())


def logs() -> list[bytes]:
    """Logs of several loggers."""
    return [
        log
        for pattern in ("examples/*.KSU", "examples/*.dat", "test/data/*.csv")
        for log in shipped(pattern, 5000)()
    ]


def read_logger(path: Path) -> None:
    """A log, by its format as it is found, and by each format that is given."""
    lines = path.read_bytes().splitlines()
    for logger in logger_names():
        with suppress(SoilmoistError):
            parse_log(lines, logger, 5.0, path)
    read_log(path)


def read_live(data: bytes) -> None:
    """Lines of a logger and a receiver, in turns."""
    stream = SensorStream(Site(), FRAME, "thorvald_crs")
    for number, line in enumerate(data.splitlines()[:400]):
        stream.take_logger_line(line, float(number))
        stream.take_nmea_line(line)
        stream.take_ready(float(number))
    stream.take_ready(1e9)


def live_lines() -> list[bytes]:
    """What a simulated robot sends in two minutes."""
    from soilmoist_ros.simulation.mission.settings import MissionSettings
    from soilmoist_ros.simulation.robot.faulty_link import Sent
    from soilmoist_ros.simulation.system import VirtualSystem

    outputs = VirtualSystem(MissionSettings(field="rough"), 1_780_000_000.0).advance(120.0)[0]
    return [b"".join(output.data for output in outputs if isinstance(output, Sent))]


def read_bag(path: Path) -> None:
    """A bag: what is in it, all its messages, and what can be recovered."""
    bag_info(path)
    try:
        reader = BagReader(path)
        for message in reader.messages():
            try:
                reader.decode(message)
            except SoilmoistError:
                continue
    finally:
        recover_bag(path, path.parent / "recovered")


def read_journal(path: Path) -> None:
    """A journal, with its snapshot."""
    found = load_journal(path.parent)
    if found.snapshot is not None:
        state_from_json(found.snapshot)


def journal() -> list[bytes]:
    """A journal of some events."""
    from soilmoist_ros.recording.journal import ENTRIES, Journal

    with tempfile.TemporaryDirectory() as folder:
        with Journal.open(Path(folder)) as written:
            for number in range(20):
                written.append("event", {"number": number, "text": "é" * number, "place": [1.5, float(number)]})
        return [Path(folder, ENTRIES).read_bytes()]


def read_raster(path: Path) -> None:
    """A covariate on the grid of a field."""
    grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], cell_m=10.0)
    read_covariates([CovariateSource.parse(str(path))], FRAME, grid)


def read_map(data: bytes) -> None:
    """The topological map of a navigation."""
    parse_topological_map(data.decode(errors="replace"))


def travel_map() -> list[bytes]:
    """The map of a lattice."""
    from soilmoist_ros.cli.main import main

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "map.yaml")
        main(["graph", "smooth", "--out", str(file)], standalone_mode=False)
        return [file.read_bytes()]


def drawn(suffix: str) -> Callable[[bytes], object]:
    """Reads a boundary that somebody sends to the page."""
    return lambda data: outline(
        {"name": f"field{suffix}", "content": base64.b64encode(data).decode(), "datum": None}
    )


KML = (
    '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><name>f</name><Polygon>'
    "<outerBoundaryIs><LinearRing><coordinates>"
    + " ".join(f"{x},{y},0" for x, y in SQUARE)
    + "</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></Document></kml>"
)
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
FIELD = """name: f
datum: [52.0, 5.0]
polygon: [[0, 0], [60, 0], [60, 50], [0, 50]]
no_go: [[[10, 10], [20, 10], [20, 20]]]
"""


def read_geojson_field(path: Path) -> None:
    """A field file with its boundary in GeoJSON."""
    file = path.parent / "field.yaml"
    file.write_text(f"name: f\ngeojson: {path.name}\n")
    load_field(file)


def read_request(data: bytes) -> None:
    """A command of the operator's page."""
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
    "truth": Target(load_surrogate, shipped("config/fields/*.yaml"), "truth.yaml"),
    "bag": Target(read_bag, shipped("test/golden/*/bag/*.mcap"), "bag/bag_0.mcap"),
    "journal": Target(read_journal, journal, "journal/entries.jsonl"),
    "records": Target(read_records, texts("stamp_s,x_m,y_m,raw_counts\n1,2,3,4\n"), "records.csv"),
    "cores": Target(read_soil_cores, shipped("examples/*cores.csv"), "cores.csv"),
    "monitor": Target(
        read_neutron_monitor, texts("start_date_time;RCORR_E\n2021-10-01 00:00:00;101.5\n"), "monitor.txt"
    ),
    "raster": Target(read_raster, lambda: [raster()], "covariate.tif"),
    "topological_map": Target(read_map, travel_map),
    "mission": Target(lambda data: state_from_json(data.decode(errors="replace")), texts({"phase": "idle"})),
    "request": Target(
        read_request, texts({"verb": "measure", "place": [1, 2]}), refusals=(SoilmoistError, ValueError)
    ),
    "drawn_geojson": Target(drawn(".geojson"), texts(GEOJSON)),
    "drawn_kml": Target(drawn(".kml"), texts(KML)),
}

_TOKENS = (
    b"", b"\x00", b"\xff" * 8, b"nan", b"-inf", b"1e999", b"-1", b"9" * 400, b"{", b"[" * 3000, b'"', b"\r",
    b"\n" * 50, b"&a *a ", b"!!python/object:os.system ", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"null", b"true",
    b"0000", b"24:61:61",
)  # fmt: skip


def mutated(data: bytes, rng: random.Random) -> bytes:
    """An input with one to four changes: bits, pieces that are dropped, repeated, moved or replaced, and cuts."""
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
