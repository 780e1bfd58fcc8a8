# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Layouts of the viewers RViz, Foxglove and PlotJuggler for a robot's namespace and a field of any size."""

from __future__ import annotations

import copy
import io
import json
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from ruamel.yaml import YAML

from soilmoist_ros.foundation import InputError, config_folder
from soilmoist_ros.mapping import Field

EXAMPLE: Final = "compaction"
"""The property that the shipped layouts have as an example."""
OUTSIDE: Final = ("diagnostics", "rosout", "tf", "tf_static", "clock")
"""Topics that do not follow a namespace."""
OF_MAPPER: Final = ("soil_map", "uncertainty", "uncertainty_updates", "samples")
"""What a mapper shows, which may belong to one robot or, outside their namespaces, to all."""
_PIXELS: Final = 600.0
"""Height of a window on the field, about [px]."""
_LINES: Final = 100
"""Lines of a reference grid at most."""
_NAMESPACE: Final = re.compile(r"[A-Za-z_]\w*(/[A-Za-z_]\w*)*")


def write_layouts(field: Field, namespace: str, properties: Sequence[str], out: Path) -> list[Path]:
    """Write the layouts of the viewers.

    :param field: the field: its extent sets the view, its cells the size of the points
    :param namespace: namespace of the robot, empty for none
    :param properties: further properties that are mapped
    :param out: folder to write to
    :returns: the files
    :raises InputError: if a name is not a namespace, or a file cannot be written
    """
    for name in (namespace.strip("/"), *(one.strip("/") for one in properties)):
        if name and not _NAMESPACE.fullmatch(name):
            raise InputError(f"{name!r} is not a namespace", "namespaces look like robot_1 or farm/robot_1")
    prefix = f"/{namespace.strip('/')}" if namespace.strip("/") else ""
    names = [one.strip("/") for one in properties]
    files = {
        "soilmoist.rviz": _rviz(field, prefix, names),
        "foxglove.json": _foxglove(field, prefix, names),
        "plotjuggler.xml": _plotjuggler(prefix),
    }
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            (out / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another folder", out) from None
    return [out / name for name in files]


def _rviz(field: Field, prefix: str, properties: Sequence[str]) -> str:
    yaml = YAML(typ="safe")
    layout = yaml.load(config_folder() / "rviz" / "soilmoist.rviz")
    manager = layout["Visualization Manager"]
    centre, step_m = _centre(field), _grid_step_m(field)
    displays: list[dict[str, Any]] = []
    for display in manager["Displays"]:
        if display["Class"].endswith("/Grid"):
            display |= {"Name": f"Grid of {step_m:g} m", "Cell Size": step_m}
            display["Plane Cell Count"] = _grid_cells(field, step_m)
        if display.get("Style") == "Flat Squares":
            display["Size (m)"] = field.grid().cell_m
        topic = display.get("Topic", {}).get("Value", "")
        for name in properties if f"/{EXAMPLE}/" in topic else [EXAMPLE]:
            own = copy.deepcopy(display)
            own["Name"] = own["Name"].replace(EXAMPLE, name)
            if topic:
                own["Topic"]["Value"] = topic.replace(f"/{EXAMPLE}/", f"/{name}/")
            displays.append(own)
    shared = [one for one in displays if prefix and _base(one.get("Topic", {}).get("Value", "")) in OF_MAPPER]
    others = [{**one, "Name": one["Name"] + " (shared mapper)"} for one in shared]
    manager["Displays"] = [*_below(displays, prefix), *others]
    manager["Views"]["Current"] |= {
        "X": centre[0], "Y": centre[1], "Scale": round(_PIXELS / field.extent_m, 4),
    }  # fmt: skip
    text = io.StringIO()
    yaml.default_flow_style = False
    yaml.dump(layout, text)
    return f"# RViz layout of {field.name}, made by soilmoist watch --layouts: rviz2 -d FILE\n{text.getvalue()}"


def _foxglove(field: Field, prefix: str, properties: Sequence[str]) -> str:
    layout = json.loads((config_folder() / "foxglove" / "soilmoist.json").read_text(encoding="utf-8"))
    panels, extent_m, step_m = layout["configById"], field.extent_m, _grid_step_m(field)
    for name, panel in panels.items():
        if name.startswith("CallService!") and prefix:
            panel["foxglovePanelTitle"] += f" ({prefix})"
    map_panel = panels["3D!map"]
    map_panel["cameraState"] |= {
        "targetOffset": [*_centre(field), 0], "distance": round(1.5 * extent_m, 1),
        "far": max(5000, round(10 * extent_m)),
    }  # fmt: skip
    cells = _grid_cells(field, step_m)
    map_panel["layers"]["grid"] |= {"label": f"Grid of {step_m:g} m", "size": cells * step_m, "divisions": cells}
    # A point has pixels, not metres: about those of a cell when the whole field is in view.
    pixels = min(30, max(2, math.ceil(0.8 * _PIXELS * field.grid().cell_m / extent_m)))
    topics: dict[str, Any] = {}
    for topic, settings in map_panel.pop("topics").items():
        if settings.get("pointShape") == "square" and _base(topic) == "soil_map":
            settings["pointSize"] = pixels
        for name in properties if f"/{EXAMPLE}/" in topic else [EXAMPLE]:
            own = topic.replace(f"/{EXAMPLE}/", f"/{name}/")
            topics[_below(own, prefix)] = settings
            if prefix and _base(own) in OF_MAPPER:
                topics[own] = settings
    panels |= _below(panels, prefix)
    panels["3D!map"]["topics"] = topics
    return json.dumps(layout, indent=2, ensure_ascii=False) + "\n"


def _plotjuggler(prefix: str) -> str:
    root = ET.parse(config_folder() / "plotjuggler" / "soilmoist.xml")
    for element in [*root.iter("curve"), *root.iter("topic")]:
        element.set("name", _below(element.attrib["name"], prefix))
    return ET.tostring(root.getroot(), encoding="unicode", xml_declaration=True) + "\n"


def _below(value: Any, prefix: str) -> Any:
    """A topic, maybe with a field, in a namespace; or a copy of a structure with all its topics there.

    >>> _below(["/mission_state.phase", "/diagnostics"], "/robot_1")
    ['/robot_1/mission_state.phase', '/diagnostics']
    """
    if isinstance(value, dict):
        return {key: _below(one, prefix) for key, one in value.items()}
    if isinstance(value, list):
        return [_below(one, prefix) for one in value]
    if not (isinstance(value, str) and value.startswith("/")):
        return value
    return value if re.split(r"[/.]", value[1:])[0] in OUTSIDE else prefix + value


def _base(topic: str) -> str:
    return topic.rpartition("/")[2]


def _centre(field: Field) -> list[float]:
    """Centre of the field [m]."""
    low, high = field.polygon.min(axis=0), field.polygon.max(axis=0)
    return [round(float(middle), 2) for middle in (low + high) / 2]


def _grid_step_m(field: Field) -> float:
    """Side of a cell of the reference grid [m]: 10, 100, ..."""
    reach_m = float(np.abs(field.polygon).max())
    return 10.0 * 10.0 ** max(0, math.ceil(math.log10(2 * reach_m / 10.0 / _LINES)))


def _grid_cells(field: Field, step_m: float) -> int:
    """Cells of a grid about the datum that covers the field: an even number."""
    return 2 * math.ceil(float(np.abs(field.polygon).max()) / step_m + 1)
