# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The tutorials: notebooks that run from the top to the end."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((ROOT / "docs" / "tutorials").glob("*.ipynb"))


def cells(path):
    return [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_its_outputs(path):
    assert all((cell["outputs"], cell["execution_count"]) == ([], None) for cell in cells(path))


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("1_log_to_map", "95% interval: 90% of 40 left-out counts lie inside"),
        ("2_compare_strategies", "gcb / lattice: "),
        ("3_own_field_and_strategy", "'gcb', 'thrifty']"),
    ],
)
def test_a_notebook_runs(name, shown, tmp_path):
    pytest.importorskip("nbclient", reason="the tutorials need requirements-docs.txt")
    path = ROOT / "docs" / "tutorials" / f"{name}.ipynb"
    run = subprocess.run(
        [sys.executable, ROOT / "scripts" / "docs", "--notebooks", tmp_path, path],
        cwd=tmp_path, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr  # the kernel's own sockets may complain when it ends
    outputs = [output for cell in cells(tmp_path / path.name) for output in cell["outputs"]]
    assert shown in "".join("".join(output.get("text", ())) for output in outputs)
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= (1 if name.startswith("3") else 2)
    assert [output["text"] for output in outputs if output.get("name") == "stderr"] == []


def test_every_notebook_is_run():
    assert [path.stem for path in NOTEBOOKS] == [
        "1_log_to_map", "2_compare_strategies", "3_own_field_and_strategy"
    ]  # fmt: skip
