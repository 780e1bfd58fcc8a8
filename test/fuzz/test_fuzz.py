"""Inputs that once broke a reader, and some changed ones; ``scripts/fuzz`` looks for more."""

import importlib.util
import random
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOUND = Path(__file__).parent / "found"
TRIES = 15


@pytest.fixture(scope="module")
def fuzz():
    """``scripts/fuzz_targets.py`` as a module."""
    spec = importlib.util.spec_from_file_location("fuzz_targets", ROOT / "scripts/fuzz_targets.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["fuzz_targets"] = module
    spec.loader.exec_module(module)
    return module


NAMES = (
    "log", "live", "nmea", "field", "geojson", "site", "scenario", "campaign", "truth", "bag", "journal",
    "records", "cores", "monitor", "raster", "topological_map", "mission", "request", "drawn_geojson", "drawn_kml",
)  # fmt: skip


def test_every_target_is_tried(fuzz):
    assert tuple(fuzz.TARGETS) == NAMES


@pytest.mark.parametrize("path", sorted(FOUND.rglob("*.bin")), ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_what_broke_a_reader_is_refused_now(fuzz, path):
    fuzz.TARGETS[path.parent.name](path.read_bytes())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.slow
def test_changed_files_are_read_or_refused(fuzz, name):
    target, rng = fuzz.TARGETS[name], random.Random(name)
    seeds = target.seeds()
    assert seeds
    for seed in seeds:
        target(seed)
    for _ in range(TRIES):
        target(fuzz.mutated(rng.choice(seeds), rng))


def test_a_fault_of_a_reader_is_seen(fuzz):
    def breaks(data):
        raise KeyError("missing")

    def hangs(data):
        while True:
            pass

    with pytest.raises(KeyError):
        fuzz.Target(breaks, list)(b"")
    fuzz.LIMIT_S = 0.2
    try:
        with pytest.raises(TimeoutError):
            fuzz.Target(hangs, list)(b"")
    finally:
        fuzz.LIMIT_S = 20.0
