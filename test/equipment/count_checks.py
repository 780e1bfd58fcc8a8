# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How good the tests of counts are: false alarms in days of good records, and maps with faults against clean ones.

usage: .venv/bin/python test/equipment/count_checks.py alarms|faults [--days 10] [--seeds 5] [--save]

Both tables depend on nothing but their seeds.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS.parent / "scripts")]  # virtual surveys, results
import numpy as np
import results

from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.sensing import CountRecord, LoggerRecord, Site, parse_nmea
from soilmoist_ros.sensing.checks.record_checks import Checked, RecordChecks
from soilmoist_ros.sensing.survey.survey import Survey
from soilmoist_ros.simulation.fields.catalogue import half_wet_field
from soilmoist_ros.simulation.robot.scenario import SensorFaults
from virtual_survey import VirtualLog, serpentine, simulate_log, stop_and_go

DAY_S = 86400.0


@dataclass(frozen=True)
class Sensor:
    """A good sensor.

    :param name: name in the table
    :param tubes: number of tubes
    :param period_s: duration of a record [s]
    :param rate_cps: mean rate [counts/s]
    :param days: how many days are simulated for each day that is asked for
    """

    name: str
    tubes: int
    period_s: float
    rate_cps: float
    days: float = 1.0


SENSORS = (
    Sensor("robot, 12 tubes, 10 s", 12, 10.0, 4.0),
    Sensor("robot at high rates", 12, 10.0, 40.0),
    Sensor("rover, 8 tubes, 1 min", 8, 60.0, 6.0, 4.0),
    Sensor("rover, 2 tubes, 1 min", 2, 60.0, 5.0, 4.0),
    Sensor("small probe, 2 tubes, 10 s", 2, 10.0, 0.5),
    Sensor("station, 1 tube, 1 h", 1, 3600.0, 0.5, 100.0),
    Sensor("station, 3 tubes, 1 h", 3, 3600.0, 0.6, 100.0),
)


def good_rates(sensor: Sensor, count: int, driving: bool, rng: np.random.Generator) -> np.ndarray:
    """True rate of good records: soil along the way, or days, rain and drying at one place, shape (count,)."""
    time_s = np.arange(count) * sensor.period_s
    if driving:
        phases = rng.uniform(0, 2 * np.pi, 3)
        waves = (0.25, 40.0, phases[0]), (0.15, 11.0, phases[1]), (0.1, 5.0, phases[2])
        return sensor.rate_cps * np.exp(
            sum(size * np.sin(2 * np.pi * np.arange(count) / n + at) for size, n, at in waves)
        )
    wetness, wet = np.zeros(count), 0.0
    rain = rng.random(count) < sensor.period_s / (4 * DAY_S)
    for index in range(count):
        wet = min(wet + 0.3 * rng.random(), 0.5) if rain[index] else wet * np.exp(-sensor.period_s / (5 * DAY_S))
        wetness[index] = wet
    return sensor.rate_cps * np.exp(0.02 * np.sin(2 * np.pi * time_s / DAY_S) - wetness)


def alarms(sensor: Sensor, days: float, driving: bool, seed: int) -> tuple[Counter[str], int]:
    """False alarms by kind, and bad tube records in total; an alarm may last for several records."""
    rng = np.random.default_rng(seed)
    count = round(days * DAY_S / sensor.period_s)
    shares = rng.dirichlet(np.full(sensor.tubes, 60.0))
    counts = rng.poisson(good_rates(sensor, count, driving, rng)[:, None] * shares * sensor.period_s)
    checks, found, lost = RecordChecks(), Counter(), 0
    before: set[str] = set()
    for index, row in enumerate(counts):
        stamp_s = 1.7e9 + index * sensor.period_s
        record = LoggerRecord(stamp_s, tuple(map(float, row)), (sensor.period_s,) * sensor.tubes)
        kinds = [finding.kind.value for finding in checks.check(record).findings]
        x_m = index * sensor.period_s if driving else 0.0
        total = CountRecord(stamp_s, x_m, 0.0, 0.0, int(row.sum()), sensor.period_s, sensor.period_s)
        kinds += [finding.kind.value for finding in checks.totals.check(total)]
        found += Counter(set(kinds) - before)
        lost += len(kinds)
        before = set(kinds)
    found += Counter(finding.kind.value for finding in checks.totals.findings)
    return found, lost


FAULTS: dict[str, dict[str, object]] = {
    "a dead tube": {"tubes": [{"tube": 3, "kind": "factor", "value": 0, "at_s": 900, "for_s": 9e9}]},
    "a tube dead from the start": {"tubes": [{"tube": 3, "kind": "factor", "value": 0, "at_s": 0, "for_s": 9e9}]},
    "a noisy tube": {"tubes": [{"tube": 5, "kind": "noise", "value": 2, "at_s": 900, "for_s": 1800}]},
    "bursts in a tube": {
        "tubes": [{"tube": 7, "kind": "noise", "value": 30, "at_s": 300 + 600 * n, "for_s": 60} for n in range(9)]
    },
    "a stuck tube": {"tubes": [{"tube": 8, "kind": "stuck", "value": 9, "at_s": 900, "for_s": 9e9}]},
    "three bad tubes": {
        "tubes": [
            {"tube": 1, "kind": "factor", "value": 0, "at_s": 600, "for_s": 9e9},
            {"tube": 2, "kind": "noise", "value": 20, "at_s": 1200, "for_s": 9e9},
            {"tube": 3, "kind": "stuck", "value": 12, "at_s": 1800, "for_s": 9e9},
        ]
    },
    "1.2 million counts": {"counts": [{"tube": 1, "nth": 40, "every": 97, "counts": 1_200_000}]},
    "all tubes noisy": {
        "tubes": [{"tube": n, "kind": "noise", "value": 4, "at_s": 1500, "for_s": 60} for n in range(1, 13)]
    },
    "all tubes noisy for 10 min": {
        "tubes": [{"tube": n, "kind": "noise", "value": 4, "at_s": 1500, "for_s": 600} for n in range(1, 13)]
    },
    "300 hPa": {"weather": [{"quantity": "pressure_hpa", "value": 300, "at_s": 900, "for_s": 600}]},
    "a jump of 40 hPa": {"weather": [{"quantity": "pressure_hpa", "value": 965, "at_s": 900, "for_s": 40}]},
    "40 hPa too low for 15 min": {
        "weather": [{"quantity": "pressure_hpa", "value": 965, "at_s": 1200, "for_s": 900}]
    },
    "drift of 7 s/h": {"clock_drift": 0.002},
}
"""Faults of the sensor in a survey, by name."""


def simulated(faults: SensorFaults, seed: int) -> VirtualLog:
    """A survey of the half-wet field with a faulty sensor."""
    field = half_wet_field()
    trajectory = stop_and_go(serpentine(field.polygon, 10.0), 120.0)
    return simulate_log(field, trajectory, np.random.default_rng(seed), faults=faults)


def map_error(log: VirtualLog, checked: bool = True) -> tuple[float, int]:
    """Root mean squared error of the map that grows on line [counts/s], and the number of quarantined records."""
    field = half_wet_field()
    survey = Survey(Site(), field.frame)
    if not checked:
        survey.checks.check = lambda record, unused_tubes=(): Checked(record)  # type: ignore[method-assign]
        survey.checks.totals.check = lambda record, recorded=None: []  # type: ignore[method-assign]
    grid = field.field.grid(1.0, 10.0)
    growing = FieldMap(grid, FieldMapSettings(merge_radius_m=2.5))
    fixes, _ = parse_nmea([line.encode() for line in log.nmea_lines], None)
    waiting = iter(fixes)
    fix = next(waiting, None)
    for record in log.records:
        while fix is not None and fix.stamp_s <= record.stamp_s:
            survey.take_fix(fix)
            fix = next(waiting, None)
        survey.take_record(record, record.stamp_s)
        for ready in survey.take_ready(record.stamp_s):
            growing.add(ready)
    for ready in survey.take_ready():
        growing.add(ready)
    soil_map = growing.update()
    assert soil_map is not None
    error = soil_map.rate[grid.mask] - field.rate_at(grid.cells)
    return float(np.sqrt(np.mean(error**2))), sum(bool(record.quarantine) for record in growing.track)


def main() -> None:
    options = results.parser(__doc__)
    options.add_argument("table", choices=["alarms", "faults"])
    options.add_argument("--days", type=float, default=10.0)
    options.add_argument("--seeds", type=int, default=5)
    chosen = options.parse_args()
    if chosen.table == "alarms":
        rows = [alarm_row(sensor, driving, chosen.days) for sensor in SENSORS for driving in (False, True)]
        columns = ("good records", "robot or rover", "days", "alarms a day", "tube records lost", "kinds")
        results.publish("false_alarms", columns, rows, "counts of Poisson statistics, seed 1", chosen.save)
        return
    clean = np.array([map_error(simulated(SensorFaults(), seed))[0] for seed in range(chosen.seeds)]).mean()
    rows = [fault_row(name, chosen.seeds, clean) for name in FAULTS]
    settings = f"error by that of the map of clean data, {clean:.4f} counts/s over {chosen.seeds} seeds"
    results.publish(
        "faults", ("fault", "error", "without the tests", "records left out"), rows, settings, chosen.save
    )


def alarm_row(sensor: Sensor, driving: bool, asked_days: float) -> tuple[str, ...]:
    days = asked_days * sensor.days
    found, lost = alarms(sensor, days, driving, seed=1)
    share = lost / (days * DAY_S / sensor.period_s * sensor.tubes)
    kinds = ", ".join(f"{kind}: {count}" for kind, count in found.items())
    where = "driving" if driving else "standing"
    return sensor.name, where, f"{days:.0f}", f"{found.total() / days:.3f}", f"{share:.1e}", kinds


def fault_row(name: str, seeds: int, clean: float) -> tuple[str, ...]:
    faults = SensorFaults.model_validate(FAULTS[name])
    logs = [simulated(faults, seed) for seed in range(seeds)]
    errors = [map_error(log) for log in logs]
    blind = [map_error(log, checked=False)[0] for log in logs]
    checked = np.mean([error for error, _ in errors])
    return name, f"{checked / clean:.2f}", f"{np.mean(blind) / clean:.2f}", f"{sum(bad for _, bad in errors)}"


if __name__ == "__main__":
    main()
