# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Makes what the site shows and what takes minutes: the runs of the gallery, and the tutorials with their outputs.

usage: .venv/bin/python scripts/docs_runs.py DIR [NOTEBOOK...]
With notebooks, only these are run.

Runs are kept in DIR/runs. scripts/site_pages.py puts DIR/made/gallery and DIR/made/tutorials into the site.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from traitlets.config import Config

ROOT = Path(__file__).resolve().parent.parent
SOILMOIST = Path(sys.executable).with_name("soilmoist")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
NOTEBOOK_LIMIT_S = 300
"""A cell that takes longer is an error."""


@dataclass(frozen=True)
class Exhibit:
    """One run of the gallery.

    :param name: folder of the run
    :param title: what it is
    :param about: what to look at
    :param command: arguments of ``soilmoist``, without ``--out``; ``RUNS`` stands for the folder of all runs
    :param picture: whether a map is drawn; otherwise the report is photographed if there is a browser
    """

    name: str
    title: str
    about: str
    command: str
    picture: bool = True


GALLERY = (
    Exhibit(
        "rover", "A public roving record",
        "A car with a bare probe near Gypsum, Kansas: 201 minutes along roads.",
        "map examples/rover_gypsum_transect_2018-05-01.KSU --logger hydroinnova_rover --site gypsum_transect",
    ),
    Exhibit(
        "station", "A public stationary record",
        "One place for eleven days, with rain at the end: a series instead of a map.",
        "map examples/station_kansas_2021-10.dat --site station_kansas", picture=False,
    ),
    Exhibit(
        "patches", "A robot explores patches of moisture",
        "An hour of the recommended strategy. The report compares map and truth.",
        "simulate --field patches --hours 1 --seed 1",
    ),
    Exhibit(
        "airfield", "The paper's airfield",
        "Wet grass and dry concrete: the published strategy, dwell and map.",
        "simulate --field synthetic-high --preset paper --hours 2 --seed 1",
    ),
    Exhibit(
        "validation", "Seven hectares, a part irrigated",
        "Four hours on the paper's validation field.",
        "simulate --field validation --hours 4 --seed 1",
    ),
    Exhibit(
        "strips", "Rough and flat ground",
        "Where the counts ask for it, intervals differ from place to place.",
        "simulate --field strips --hours 2 --seed 1",
    ),
    Exhibit(
        "robots", "Three robots, one map",
        "Half an hour from one corner. No robot goes where another goes.",
        "simulate --field patches --robots 3 --hours 0.5 --seed 1",
    ),
    Exhibit(
        "properties", "Two properties",
        "A second sensor counts the rate of another field; the robot plans for both maps.",
        "simulate --field smooth --property rough:0.5 --hours 1 --seed 1",
    ),
    Exhibit(
        "today", "With four earlier surveys",
        "Half an hour that knows what was counted before, and what has changed since.",
        "simulate --field synthetic-low --hours 0.5 --earlier-surveys 4 --seed 1",
    ),
    Exhibit(
        "season", "A season of surveys",
        "The five surveys of the run before, with a slider for the date.",
        "season RUNS/today RUNS/today/earlier", picture=False,
    ),
    Exhibit(
        "campaign", "A campaign",
        "Four strategies on two fields, three seeds each.",
        "campaign docs/site/gallery.yaml", picture=False,
    ),
)  # fmt: skip


def photograph(report: Path, picture: Path) -> bool:
    """Photograph the top of a report with a browser; whether there is one."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        return False
    subprocess.run(
        [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1000,700",
            "--virtual-time-budget=4000", f"--screenshot={picture}", report.resolve().as_uri(),
        ],
        check=True, capture_output=True, timeout=120,
    )  # fmt: skip
    return True


def exhibit(entry: Exhibit, runs: Path, made: Path) -> dict[str, object]:
    """Run one command, and copy its report with a picture; what the gallery says about it."""
    out, folder = runs / entry.name, made / entry.name
    arguments = entry.command.replace("RUNS", str(runs)).split()
    overwrite = [] if arguments[0] == "campaign" else ["--overwrite"]
    begin = time.perf_counter()
    run = subprocess.run(
        [SOILMOIST, *arguments, "--out", out, *overwrite], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if run.returncode != 0:
        raise SystemExit(f"soilmoist {' '.join(arguments)}: exit code {run.returncode}\n{run.stderr}")
    print(f"{entry.name}: {time.perf_counter() - begin:.0f} s", flush=True)
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(out / "report.html", folder / "report.html")
    picture = folder / "picture.png"
    if entry.picture:
        subprocess.run([sys.executable, ROOT / "scripts" / "picture", out, picture, "--map"], check=True)
        drawn = True
    else:
        drawn = photograph(folder / "report.html", picture)
    command = entry.command.replace("RUNS", "out")
    return {**asdict(entry), "command": f"soilmoist {command} --out out/{entry.name}", "picture": drawn}


def run_notebook(path: Path) -> nbformat.NotebookNode:
    """Run a notebook in the folder of the project; a cell that fails is an error."""
    notebook = nbformat.read(path, as_version=4)
    folder = {"metadata": {"path": str(ROOT)}}
    # By TCP, any user of the machine could send code to the kernel, which warns of it.
    with tempfile.TemporaryDirectory() as sockets:
        local = Config(KernelManager={"transport": "ipc", "ip": f"{sockets}/kernel"})
        NotebookClient(
            notebook,
            kernel_name="python3",
            timeout=NOTEBOOK_LIMIT_S,
            iopub_timeout=60,  # its default of 4 s loses outputs on a busy machine
            resources=folder,
            config=local,
        ).execute()
    return notebook


def tutorials(notebooks: Sequence[Path], made: Path) -> None:
    """Run notebooks, and keep each with its outputs."""
    made.mkdir(parents=True, exist_ok=True)
    for path in notebooks:
        begin = time.perf_counter()
        nbformat.write(run_notebook(path), made / path.name)
        print(f"{path.stem}: {time.perf_counter() - begin:.0f} s", flush=True)


def main() -> int:
    """Make everything below the folder that is named."""
    if len(sys.argv) < 2:
        print(__doc__)
        return 2
    out, chosen = Path(sys.argv[1]).resolve(), [Path(name) for name in sys.argv[2:]]
    made = out / "made"
    if not chosen:
        print("== the runs of the gallery (a few minutes)", flush=True)
        shown = [exhibit(entry, out / "runs", made / "gallery") for entry in GALLERY]
        (made / "gallery" / "gallery.json").write_text(json.dumps(shown, indent=1), encoding="utf-8")
        print("== the tutorials", flush=True)
    tutorials(chosen or sorted((ROOT / "docs" / "tutorials").glob("*.ipynb")), made / "tutorials")
    return 0


if __name__ == "__main__":
    sys.exit(main())
