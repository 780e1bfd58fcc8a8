# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files that driver, mapper and planner enter while records become a map and a plan.

As a program it is a node that notes the files whose functions are called: ``python walk.py NODE FOLDER ...``.
While FOLDER/begin is there and FOLDER/end is not, it notes; then it writes FOLDER/NODE, a file name a line.
"""

from __future__ import annotations

import importlib
import runpy
import sys
import threading
import time
from inspect import CO_OPTIMIZED
from pathlib import Path

import soilmoist_ros

ROOT = Path(soilmoist_ros.__file__).parents[1]
NODES = ("sensor_driver", "mapper", "planner")


def watch(folder: Path, name: str) -> None:
    """Note the files that this process enters, in threads that begin from now on."""
    entered: set[str] = set()

    def called(frame, event, argument):
        if frame.f_code.co_flags & CO_OPTIMIZED:  # a function: no module or class that is being made
            entered.add(frame.f_code.co_filename)

    def follow() -> None:
        while not (folder / "begin").exists():
            time.sleep(0.02)
        entered.clear()
        while not (folder / "end").exists():
            time.sleep(0.02)
        paths = [Path(name) for name in sorted(entered)]
        ours = [path.relative_to(ROOT).as_posix() for path in paths if path.is_relative_to(ROOT)]
        product = [path for path in ours if path.startswith(("soilmoist_ros/", "msg_adapters/"))]
        (folder / f"{name}.part").write_text("\n".join(product))
        (folder / f"{name}.part").rename(folder / name)

    threading.Thread(target=follow, daemon=True).start()
    threading.setprofile(called)
    sys.setprofile(called)


def entered_files(nodes, folder: Path, cycle, limit_s: float = 60.0) -> set[str]:
    """Files that the watched nodes enter while ``cycle`` waits for a record, its map and a plan.

    :param nodes: real nodes whose programs are this file
    """
    (folder / "begin").touch()
    cycle()
    (folder / "end").touch()
    until_s = time.monotonic() + limit_s
    while not all((folder / name).exists() for name in NODES) and time.monotonic() < until_s:
        time.sleep(0.05)
    return {line for name in NODES for line in (folder / name).read_text().splitlines()}


if __name__ == "__main__":
    node, folder = sys.argv.pop(1), Path(sys.argv.pop(1))
    importlib.import_module(f"soilmoist_ros.nodes.{node}")
    watch(folder, node)
    runpy.run_module(f"soilmoist_ros.nodes.{node}", run_name="__main__", alter_sys=True)
