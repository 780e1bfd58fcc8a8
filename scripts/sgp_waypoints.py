#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Way-points of SGP-Tools' continuous planner, the reference from the literature in ``bench_lattice.py``.

SGP-Tools (Jakkala and Akella, https://pypi.org/project/sgptools) places way-points as the inducing points of a
sparse Gaussian process. It needs an environment of its own, because it needs numpy 1::

    python3 -m venv sgp && sgp/bin/pip install sgptools      # about 3 GB
    .venv/bin/python scripts/bench_lattice.py --sgp sgp/bin/python

As a program, this file runs in that environment: it reads the planning problem as JSON from its standard input,
and writes the way-points. The functions run in the environment of the project.
"""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from soilmoist_ros.mapping.variogram.model import Variogram
    from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField

Array = NDArray[np.float64]

CELLS = 750
"""Approximate number of cells that represent the field."""
MAX_STEPS = 200
"""Steps of the search for the places."""


def plan(problem: dict[str, Any]) -> Array:
    """Places of the way-points, shape (n, 2) [m]; runs in the environment of SGP-Tools.

    :param problem: ``count``, ``cells`` [m], ``range_m`` of the Matern 3/2 model, ``variance`` and ``noise``
    """
    import gpflow
    from sgptools.methods import ContinuousSGP
    from sgptools.utils.misc import get_inducing_pts

    np.random.seed(1)  # noqa: NPY002 - of the planner
    cells = np.array(problem["cells"], float)
    kernel = gpflow.kernels.Matern32(variance=problem["variance"], lengthscales=problem["range_m"])
    first = get_inducing_pts(cells, problem["count"])
    planner = ContinuousSGP(problem["count"], cells, kernel, problem["noise"], X_init=first)
    return np.asarray(planner.optimize(max_steps=MAX_STEPS)).reshape(-1, 2)


def true_variogram(truths: list[SurrogateField]) -> Variogram:
    """Medians of the Matern 3/2 variograms that are fitted to the truths of a family of fields."""
    from soilmoist_ros.mapping.variogram.fit import fit_variogram
    from soilmoist_ros.mapping.variogram.model import Variogram

    fits = []
    for field in truths:
        grid = field.field.grid(None)
        cells = grid.cells[:: max(len(grid.cells) // 300, 1)]
        exposure_s = np.full(len(cells), 1e6)  # without noise
        counts = np.rint(field.rate_at(cells) * exposure_s)
        fits.append(fit_variogram(cells, counts, exposure_s, extent_m=grid.extent_m, anisotropy=False))
    nugget, range_m, sill = (
        float(np.median([getattr(fit, name) for fit in fits])) for name in ("nugget", "range_m", "sill")
    )
    return Variogram("matern32", nugget, range_m, sill)


def waypoints(python: str, field: SurrogateField, variogram: Variogram, count: int, exposure_s: float) -> Array:
    """Way-points in a field, by SGP-Tools in another interpreter, shape (count, 2) [m].

    :param python: interpreter of an environment with SGP-Tools
    :param variogram: hyperparameters that the planner is given
    :param count: number of way-points
    :param exposure_s: time that the robot is going to count at each [s]; determines the noise
    :raises InputError: if SGP-Tools cannot be run
    """
    from other_python import run_in

    cells = field.field.grid(None).cells
    problem = {
        "count": count,
        "cells": cells[:: max(len(cells) // CELLS, 1)].tolist(),
        "range_m": variogram.range_m,
        "variance": variogram.structured_sill,
        "noise": float(field.rate_at(cells).mean()) / exposure_s + variogram.nugget,
    }
    remedy = "python3 -m venv sgp && sgp/bin/pip install sgptools, then --sgp sgp/bin/python"
    return np.array(run_in(python, __file__, problem, "SGP-Tools", remedy), float)


if __name__ == "__main__":
    print(json.dumps(plan(json.load(sys.stdin)).tolist()))
