# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Random streams of a simulated mission; each source of randomness has an independent stream."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from soilmoist_ros.exploration import STREAMS_PER_ROBOT

_SENSOR, _GNSS = 0, 2  # between them is the stream of the strategy
_EARLIER, _COVARIATE, _PERSON, _SEALED = 0, 1, 2, 3  # keys of three numbers; the others have fewer


def field_stream(seed: int, number: int) -> np.random.Generator:
    """Random stream for the field of a property."""
    return np.random.default_rng((seed, number + 1))


def sensor_stream(seed: int, number: int = 0, robot: int = 0, robots: int = 1) -> np.random.Generator:
    """Random stream for the counts of one property's sensor on one robot.

    The keys of the first two properties are those of earlier releases, which keeps their missions reproducible.
    """
    keys = ((STREAMS_PER_ROBOT * robot + _SENSOR,), (STREAMS_PER_ROBOT * robots + robot,))
    return _stream(seed, *(keys[number] if number < len(keys) else (number, robot)))


def series_stream(seed: int, number: int, back: int) -> np.random.Generator:
    """Random stream for an earlier survey, numbered from 1, the latest first."""
    return _stream(seed, _EARLIER, number, back)


def covariate_stream(seed: int, number: int, index: int) -> np.random.Generator:
    """Random stream for a simulated covariate of a property, both numbered from 0."""
    return _stream(seed, _COVARIATE, number, index)


def gnss_stream(seed: int, robot: int = 0) -> np.random.Generator:
    """Random stream for the position errors of one robot, numbered from 0."""
    return _stream(seed, STREAMS_PER_ROBOT * robot + _GNSS)


def position_errors(seed: int, robot: int, sd_m: float) -> Iterator[tuple[float, float]]:
    """Position errors of one robot, east and north [m], without end; ``sd_m`` is that of each."""
    rng = gnss_stream(seed, robot)
    while True:  # drawn in blocks; the values equal single draws
        yield from rng.normal(0.0, sd_m, (200, 2)).tolist()


def person_stream(seed: int, robot: int) -> np.random.Generator:
    """Random stream for the trips of a person with the sensor of one robot, numbered from 0."""
    return _stream(seed, _PERSON, 0, robot)


def sealed_seed(seed: int) -> int:
    """Seed of the sealed sample of a certificate; that of a real mission cannot be foreseen."""
    return int(_stream(seed, _SEALED, 0, 0).integers(2**53))


def device_stream(seed: int, device: int, robot: int = 0, robots: int = 1) -> np.random.Generator:
    """Random stream for a device, numbered from 0, of one robot in the simulated system."""
    return _stream(seed, (STREAMS_PER_ROBOT + 1 + device) * robots + robot)


def _stream(seed: int, *key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
