# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import threading
from dataclasses import replace

import pytest

from soilmoist_ros.foundation.errors import Level
from soilmoist_ros.mapping import Change, FieldGrid, FieldMap, FieldMapSettings, MapState, MapWorker, map_health
from soilmoist_ros.mapping.drift import Jump
from soilmoist_ros.sensing.records import NAN, CountRecord

LIMIT_S = 20.0
STATES = [MapState(records=number) for number in range(1, 6)]


class Bench:
    """A worker whose work starts and ends when the test says so."""

    def __init__(self):
        self.started = threading.Semaphore(0)
        self.go_on = threading.Semaphore(0)
        self.done = threading.Semaphore(0)
        self.computed = []
        self.failing = set()
        self.worker = MapWorker(self.compute, lambda state, soil_map: self.done.release())

    def compute(self, state):
        self.started.release()
        assert self.go_on.acquire(timeout=LIMIT_S)
        self.computed.append(state.records)
        if state.records in self.failing:
            self.done.release()
            raise ValueError("a contradiction")

    def finish_one(self):
        self.go_on.release()
        assert self.done.acquire(timeout=LIMIT_S)


@pytest.fixture
def bench():
    bench = Bench()
    yield bench
    bench.go_on.release(100)
    bench.worker.close()


def test_only_the_newest_of_the_waiting_states_is_mapped(bench):
    bench.worker.submit(STATES[0])
    assert bench.started.acquire(timeout=LIMIT_S)
    for state in STATES[1:]:
        bench.worker.submit(state)
    bench.finish_one()
    bench.finish_one()
    assert bench.computed == [1, 5]


def test_a_state_is_not_mapped_twice(bench):
    bench.worker.submit(STATES[0])
    assert bench.started.acquire(timeout=LIMIT_S)
    bench.worker.submit(STATES[0])
    bench.finish_one()
    assert not bench.started.acquire(timeout=0.1)
    assert bench.computed == [1]


def test_a_map_that_is_finished_after_the_end_is_not_published(bench):
    """The map of a field that was left must not be taken for one of the next field."""
    bench.worker.submit(STATES[0])
    assert bench.started.acquire(timeout=LIMIT_S)
    bench.worker.close(0.01)
    bench.go_on.release()
    bench.worker.close(LIMIT_S)
    assert bench.computed == [1]
    assert not bench.done.acquire(blocking=False)


def test_a_failure_is_kept_and_the_next_map_is_made_all_the_same(bench, caplog):
    bench.failing = {1}
    bench.worker.submit(STATES[0])
    bench.finish_one()
    bench.worker.submit(STATES[1])
    assert bench.started.acquire(timeout=LIMIT_S)
    assert bench.started.acquire(timeout=LIMIT_S)  # the first is over now, with its failure
    assert "a contradiction" in bench.worker.failure
    assert "a contradiction" in caplog.text
    bench.finish_one()
    bench.worker.close()
    assert bench.worker.failure == ""
    assert bench.worker.mapped is STATES[1]


def test_the_health_shows_what_the_map_rests_on():
    grid = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 50), (0, 50)], 10.0)
    field_map = FieldMap(grid, FieldMapSettings(fit="soft_l1"))
    done = threading.Semaphore(0)
    worker = MapWorker(field_map.compute, lambda state, soil_map: done.release())

    def health():
        return map_health(field_map, worker, now_s=100.0)

    assert (health().level, health().message) == (Level.OK, "waiting for the first record")
    for number, x_m in enumerate((10.0, 30.0)):
        field_map.add(CountRecord(80.0 + number, x_m, 20.0, NAN, 40, 10.0, 9.0))
    assert health().message == "waiting for enough samples for a map"
    assert health().values["records not yet in the map"] == "2"
    worker.submit(field_map.state)
    assert done.acquire(timeout=LIMIT_S)
    worker.close()
    assert (health().level, health().message) == (Level.OK, "samples in the map: 2")
    assert health().values["age of the map [s]"] == "19.0"
    assert health().values["model"] == "matern32"
    assert health().values["records not yet in the map"] == "0"
    assert float(health().values["range [m]"]) == pytest.approx(worker.soil_map.variogram.range_m, rel=0.01)
    assert health().values["rain"] == ""
    worker.soil_map = replace(worker.soil_map, change=Change(jump=Jump(-500.0, -0.5, 0.1, -0.1)))
    assert health().level is Level.WARN
    assert health().message == health().values["rain"]
    assert "the rate fell by (10 ± 2) % within minutes, 10 min ago; if it rains, wait" in health().message
    later = map_health(field_map, worker, now_s=1400.0)
    assert (later.level, later.values["rain"]) == (Level.OK, ""), "half an hour later, though no record came"
    for _ in range(3):
        field_map.add(CountRecord(90.0, NAN, NAN, NAN, 40, 10.0, 9.0))
    assert health().level is Level.WARN
    assert health().message.endswith("check the GNSS receiver and its view of the sky")
    assert health().values["skipped: no position"] == "3"
    worker.failure = "no map of 2 samples: the matrix"
    assert (health().level, health().message) == (Level.ERROR, worker.failure)
