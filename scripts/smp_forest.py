#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Random forest of soil-moisture-prediction, the tool of the field, in ``bench_covariates.py``.

soil-moisture-prediction (UFZ, https://pypi.org/project/soil-moisture-prediction) maps roving surveys by a random
forest over predictors. It needs an environment of its own, because it pins old versions::

    python3 -m venv smp && smp/bin/pip install soil-moisture-prediction      # about 1 GB
    .venv/bin/python scripts/bench_covariates.py --smp smp/bin/python

As a program, this file runs in that environment. Without input it writes the folder of the package's example data;
with a problem as JSON on its standard input it trains and predicts. The functions run in the environment of the
project.
"""

from __future__ import annotations

import json
import random
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def example_data() -> Path:
    """Folder of the example data; runs in the environment of the tool."""
    import soil_moisture_prediction

    return Path(soil_moisture_prediction.__file__).parent / "test_data"


def forest(problem: dict[str, Any]) -> list[Any]:
    """Predictions of each Monte Carlo iteration at places, for each fold; runs in the environment of the tool.

    :param problem: ``folds``, each with the lines of the ``training`` and, by day, the ``places`` [m];
        ``resolution_m`` of the grid, 0 for the one of the example
    """
    import shutil
    import tempfile

    import matplotlib

    matplotlib.use("Agg")
    from soil_moisture_prediction.pydantic_models import InputParameters
    from soil_moisture_prediction.random_forest_model import RANDOM_SEED, RFoModel

    found = []
    for fold in problem["folds"]:
        random.seed(RANDOM_SEED)  # as at the start of the tool
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for file in example_data().iterdir():
                shutil.copy(file, folder)
            settings = json.loads((folder / "parameters.json").read_text())
            settings["what_to_plot"] = dict.fromkeys(settings["what_to_plot"], False)
            if problem["resolution_m"]:
                settings["area_resolution"] = problem["resolution_m"]
            data = folder / settings["soil_moisture_data"]
            header = data.read_text().splitlines()[0]
            data.write_text("\n".join([header, *fold["training"]]) + "\n")
            model = RFoModel(input_parameters=InputParameters(**settings), work_dir=name)
            model.load_input_data()
            model.complete_prediction()
            days = model.input_data.soil_moisture_data.time_steps
            predictions = {}
            for day, places in fold["places"].items():
                nodes = model.geometry.find_nearest_node(*np.array(places, float).reshape(-1, 2).T)
                at = model.prediction[:, days.index(day)][:, nodes[:, 0], nodes[:, 1]]
                predictions[day] = at.T.tolist()
            found.append(predictions)
    return found


def run(python: str, problem: dict[str, Any] | None = None) -> Any:
    """Run this file in the environment of the tool.

    :param python: its interpreter
    :param problem: as :func:`forest`; ``None`` for the folder of the example data
    :raises InputError: if the tool cannot be run
    """
    from other_python import run_in

    remedy = "python3 -m venv smp && smp/bin/pip install soil-moisture-prediction, then --smp smp/bin/python"
    return run_in(python, __file__, problem, "soil-moisture-prediction", remedy)


if __name__ == "__main__":
    asked = json.load(sys.stdin)
    print(json.dumps(str(example_data()) if asked is None else forest(asked)))
