#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Computes soilmoist_ros/sensing/corrections/cutoff_rigidity.csv by tracing cosmic rays through the earth's field.

usage: test/equipment/cutoff_rigidity_table.py IGRF.shc OUT.csv [--epoch 2020] [--degree 10] [--places FILE]
IGRF.shc holds the coefficients of the International Geomagnetic Reference Field (https://doi.org/10.5281/zenodo.14012302)
--places computes the rows latitude,longitude of a CSV file instead of the grid

The effective vertical cutoff rigidity (Cooke et al. 1991, Il Nuovo Cimento C 14:213-234) is the sum of all
forbidden rigidities. A rigidity is forbidden if an antiproton launched upwards from 20 km altitude returns to this
altitude, or has not escaped to 25 earth radii after a limited number of steps (Shea, Smart, McCracken 1965,
Journal of Geophysical Research 70:4117-4130).
The field of the magnetosphere is left out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
EARTH_RADIUS_M = 6_371_200.0
SPEED_OF_LIGHT_MPS = 299_792_458.0
EQUATOR_M, POLE_M, START_M = 6_378_137.0, 6_356_752.3, 20_000.0
ESCAPED_RADII = 25.0
MAX_STEPS = 2500
COARSE_GV, FINE_GV, MAX_GV = 0.3, 0.02, 18.0
BATCH = 4096
UNRESOLVED_GV = 0.26
"""Below, particles gyrate so tightly that MAX_STEPS end their trace; the atmosphere stops them anyway."""


class Field:
    """The geomagnetic field [T] at Cartesian places [earth radii] (Cunningham's recursion)."""

    def __init__(self, path: Path, epoch: float, degree: int) -> None:
        lines = [line for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]
        column = [float(word) for word in lines[1].split()].index(epoch)
        size = degree + 2
        self.degree = degree
        g, h = np.zeros((size, size)), np.zeros((size, size))
        for line in lines[2:]:
            n, m, *values = line.split()
            if int(n) <= degree:
                (g if int(m) >= 0 else h)[int(n), abs(int(m))] = float(values[column]) * 1e-9
        self._pairs = [(n, m) for n in range(size) for m in range(n + 1)]
        index = {pair: row for row, pair in enumerate(self._pairs)}
        self.weights = np.zeros((3, 2, len(self._pairs)))
        for n in range(1, degree + 1):
            for m in range(n + 1):
                # from Schmidt semi-normalised to unnormalised functions without the Condon-Shortley phase
                scale = np.sqrt((2 - (m == 0)) * _factorial(n - m) / _factorial(n + m))
                self._add(index, n, m, scale * g[n, m], scale * h[n, m])

    def _add(self, index: dict[tuple[int, int], int], n: int, m: int, c: float, s: float) -> None:
        """Add the field, minus the gradient of the potential c V + s W, of one pair n, m."""
        x, y, z = self.weights
        up = index[n + 1, m + 1]
        if m == 0:
            x[0, up] += c
            y[1, up] += c
        else:
            down, half = index[n + 1, m - 1], 0.5 * (n - m + 1) * (n - m + 2)
            x[0, up] += 0.5 * c
            x[1, up] += 0.5 * s
            x[0, down] -= half * c
            x[1, down] -= half * s
            y[1, up] += 0.5 * c
            y[0, up] -= 0.5 * s
            y[1, down] += half * c
            y[0, down] -= half * s
        along = index[n + 1, m]
        z[0, along] += (n - m + 1) * c
        z[1, along] += (n - m + 1) * s

    def __call__(self, place: Array) -> Array:
        """Field at places of shape (3, n)."""
        x, y, z = place
        inverse = 1.0 / (x * x + y * y + z * z)
        x, y, z = x * inverse, y * inverse, z * inverse
        v = np.empty((len(self._pairs), place.shape[1]))
        w = np.empty_like(v)
        v[0], w[0] = np.sqrt(inverse), 0.0
        row = {pair: number for number, pair in enumerate(self._pairs)}
        for n, m in self._pairs[1:]:
            here = row[n, m]
            if n == m:
                last = row[n - 1, m - 1]
                v[here] = (2 * m - 1) * (x * v[last] - y * w[last])
                w[here] = (2 * m - 1) * (x * w[last] + y * v[last])
                continue
            last, factor = row[n - 1, m], (2 * n - 1) / (n - m)
            v[here], w[here] = factor * z * v[last], factor * z * w[last]
            if n - 2 >= m:
                before, less = row[n - 2, m], (n + m - 1) / (n - m) * inverse
                v[here] -= less * v[before]
                w[here] -= less * w[before]
        return self.weights[:, 0] @ v + self.weights[:, 1] @ w


def _factorial(n: int) -> float:
    return float(np.prod(np.arange(1, n + 1, dtype=float)))


def allowed(field: Field, place: Array, direction: Array, rigidity_gv: Array) -> NDArray[np.bool_]:
    """Whether particles of each rigidity come from space, shape (n,).

    :param place: starts [earth radii], shape (3, n)
    :param direction: unit vectors away from the earth, shape (3, n)
    """
    result = np.zeros(len(rigidity_gv), dtype=bool)
    alive = np.arange(len(rigidity_gv))
    x, u = place.copy(), direction.copy()
    bend = -SPEED_OF_LIGHT_MPS * EARTH_RADIUS_M / (rigidity_gv * 1e9)
    equator, pole = (EQUATOR_M + START_M) / EARTH_RADIUS_M, (POLE_M + START_M) / EARTH_RADIUS_M

    def turn(x: Array, u: Array) -> Array:
        bx, by, bz = field(x)
        return np.array([u[1] * bz - u[2] * by, u[2] * bx - u[0] * bz, u[0] * by - u[1] * bx]) * bend

    for _ in range(MAX_STEPS):
        radius = np.sqrt((x * x).sum(axis=0))
        k1 = turn(x, u)
        b = np.abs(bend) * 3.0e-5 * 1.1 * 2 / radius**3 + 1e-12
        h = np.minimum(0.10 / b, 0.06 * radius)
        k2 = turn(x + 0.5 * h * u, u + 0.5 * h * k1)
        k3 = turn(x + 0.5 * h * u + 0.25 * h * h * k1, u + 0.5 * h * k2)
        k4 = turn(x + h * u + 0.5 * h * h * k2, u + h * k3)
        x = x + h * u + h * h * (k1 + k2 + k3) / 6
        u = u + h * (k1 + 2 * k2 + 2 * k3 + k4) / 6
        u /= np.sqrt((u * u).sum(axis=0))
        out = (x * x).sum(axis=0) > ESCAPED_RADII**2
        down = (x[0] ** 2 + x[1] ** 2) / equator**2 + x[2] ** 2 / pole**2 < 1
        result[alive[out]] = True
        keep = ~(out | down)
        if not keep.any():
            break
        x, u, bend, alive = x[:, keep], u[:, keep], bend[keep], alive[keep]
    return result


def start(latitude_deg: float, longitude_deg: float) -> tuple[Array, Array]:
    """Place at 20 km altitude [earth radii] and the vertical, shape (3,) each."""
    latitude, longitude = np.radians(latitude_deg), np.radians(longitude_deg)
    e2 = 1 - (POLE_M / EQUATOR_M) ** 2
    normal = EQUATOR_M / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
    up = np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    flat = np.array([normal, normal, normal * (1 - e2)])
    return (flat + START_M + 1.0) * up / EARTH_RADIUS_M, up


def cutoff_rigidities(field: Field, places: Array) -> Array:
    """Effective vertical cutoff rigidity [GV] of places (latitude, longitude), shape (n,)."""
    coarse = np.arange(COARSE_GV, MAX_GV, COARSE_GV)
    low, high = np.zeros(len(places)), np.zeros(len(places))
    for number, passes in enumerate(_scan(field, places, [coarse] * len(places))):
        low[number] = coarse[np.argmax(passes)] - COARSE_GV
        high[number] = coarse[len(coarse) - np.argmin(passes[::-1]) - 1] if not passes.all() else 0.0
    fine = [
        np.arange(max(a - COARSE_GV, 0), b + COARSE_GV, FINE_GV) + FINE_GV / 2
        for a, b in zip(low, np.maximum(low, high), strict=True)
    ]
    found = _scan(field, places, fine)
    forbidden = [(~passes).sum() for passes in found]
    found_gv = np.array([each[0] + FINE_GV * (count - 0.5) for each, count in zip(fine, forbidden, strict=True)])
    return np.where(found_gv > UNRESOLVED_GV + FINE_GV / 4, found_gv, 0.0)


def _scan(field: Field, places: Array, rigidities: list[Array]) -> list[NDArray[np.bool_]]:
    owner = np.repeat(np.arange(len(places)), [len(each) for each in rigidities])
    starts = [start(latitude, longitude) for latitude, longitude in places]
    place, up = (np.array([each[part] for each in starts]).T for part in (0, 1))
    every = np.concatenate(rigidities)
    passes = np.zeros(len(every), dtype=bool)
    # Particles of like rigidity take about as long.
    order = np.argsort(every, kind="stable")
    for begin in range(0, len(every), BATCH):
        chosen = order[begin : begin + BATCH]
        passes[chosen] = allowed(field, place[:, owner[chosen]], up[:, owner[chosen]], every[chosen])
        print(f"\r{begin + len(chosen)} of {len(every)} particles", end="", flush=True)
    print()
    return np.split(passes, np.cumsum([len(each) for each in rigidities])[:-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("igrf", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--epoch", type=float, default=2020.0)
    parser.add_argument("--degree", type=int, default=10)
    parser.add_argument("--places", type=Path)
    options = parser.parse_args()
    field = Field(options.igrf, options.epoch, options.degree)
    if options.places:
        places = np.loadtxt(options.places, delimiter=",", ndmin=2)
        found = cutoff_rigidities(field, places)
        rows = [f"{a:g},{b:g},{gv:.2f}" for (a, b), gv in zip(places, found, strict=True)]
    else:
        latitudes, longitudes = np.arange(90, -91, -5.0), np.arange(-180, 180, 10.0)
        places = np.array([(a, b) for a in latitudes for b in longitudes])
        grid = cutoff_rigidities(field, places).reshape(len(latitudes), len(longitudes))
        rows = ["latitude_deg," + ",".join(f"{b:g}" for b in longitudes)]
        rows += [f"{a:g}," + ",".join(f"{gv:.2f}" for gv in row) for a, row in zip(latitudes, grid, strict=True)]
    options.out.write_text("\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
