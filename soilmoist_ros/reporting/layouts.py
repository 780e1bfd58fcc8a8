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
from collections.abc import Iterator, Sequence
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
    centre, extent_m = _view(field)
    cell_m = field.grid().cell_m
    displays: list[dict[str, Any]] = []
    for display in manager["Displays"]:
        if display["Class"].endswith("/Grid"):
            step_m = _grid_step_m(field)
            display |= {"Name": f"Grid of {step_m:g} m", "Cell Size": step_m}
            display["Plane Cell Count"] = _grid_cells(field, step_m)
        if display.get("Style") == "Flat Squares":
            display["Size (m)"] = cell_m
        displays += _with_properties(display, properties)
    shared = [one for one in displays if prefix and _base(one.get("Topic", {}).get("Value", "")) in OF_MAPPER]
    others = copy.deepcopy(shared)
    for one in others:
        one["Name"] += " (shared mapper)"
    for one in displays:
        _put_below(one, prefix)
    manager["Displays"] = displays + others
    manager["Views"]["Current"] |= {
        "X": round(centre[0], 2), "Y": round(centre[1], 2), "Scale": round(_PIXELS / extent_m, 4),
    }  # fmt: skip
    text = io.StringIO()
    yaml.default_flow_style = False
    yaml.dump(layout, text)
    return f"# RViz layout of {field.name}, made by soilmoist watch --layouts: rviz2 -d FILE\n{text.getvalue()}"


def _foxglove(field: Field, prefix: str, properties: Sequence[str]) -> str:
    layout = json.loads((config_folder() / "foxglove" / "soilmoist.json").read_text(encoding="utf-8"))
    panels = layout["configById"]
    for name, panel in panels.items():
        if name.startswith("CallService!"):
            panel["serviceName"] = prefix + panel["serviceName"]
            panel["foxglovePanelTitle"] += f" ({prefix})" if prefix else ""
        for key in ("topicPath", "followTopic", "topicName", "topicToRender"):
            if key in panel:
                panel[key] = _below(panel[key], prefix)
        for path in panel.get("paths", ()):
            path["value"] = _below(path["value"], prefix)
    centre, extent_m = _view(field)
    map_panel = panels["3D!map"]
    map_panel["cameraState"] |= {
        "targetOffset": [round(centre[0], 2), round(centre[1], 2), 0], "distance": round(1.5 * extent_m, 1),
    }  # fmt: skip
    map_panel["cameraState"]["far"] = max(5000, round(10 * extent_m))
    step_m = _grid_step_m(field)
    cells = _grid_cells(field, step_m)
    grid = map_panel["layers"]["grid"]
    grid |= {"label": f"Grid of {step_m:g} m", "size": cells * step_m, "divisions": cells}
    # A point has pixels, not metres: about those of a cell when the whole field is in view.
    pixels = min(30, max(2, math.ceil(0.8 * _PIXELS * field.grid().cell_m / extent_m)))
    topics: dict[str, Any] = {}
    for topic, settings in map_panel["topics"].items():
        if settings.get("pointShape") == "square" and _base(topic) == "soil_map":
            settings["pointSize"] = pixels
        for name in _topics(topic, properties):
            topics[_below(name, prefix)] = settings
            if prefix and _base(name) in OF_MAPPER:
                topics[name] = settings
    map_panel["topics"] = topics
    return json.dumps(layout, indent=2, ensure_ascii=False) + "\n"


def _plotjuggler(prefix: str) -> str:
    root = ET.parse(config_folder() / "plotjuggler" / "soilmoist.xml")
    for element in [*root.iter("curve"), *root.iter("topic")]:
        element.set("name", _below(element.attrib["name"], prefix))
    return ET.tostring(root.getroot(), encoding="unicode", xml_declaration=True) + "\n"


def _with_properties(display: dict[str, Any], properties: Sequence[str]) -> Iterator[dict[str, Any]]:
    """A display, or in place of the example's one for each property."""
    topic = display.get("Topic", {}).get("Value", "")
    if f"/{EXAMPLE}/" not in topic:
        yield display
        return
    for name in properties:
        made = copy.deepcopy(display)
        made["Name"] = made["Name"].replace(EXAMPLE, name)
        made["Topic"]["Value"] = topic.replace(f"/{EXAMPLE}/", f"/{name}/")
        yield made


def _topics(topic: str, properties: Sequence[str]) -> list[str]:
    """A topic, or in place of the example's one for each property."""
    if f"/{EXAMPLE}/" not in topic:
        return [topic]
    return [topic.replace(f"/{EXAMPLE}/", f"/{name}/") for name in properties]


def _put_below(settings: dict[str, Any], prefix: str) -> None:
    """Put the topics of a display, at any depth, into a namespace."""
    for key, value in settings.items():
        if isinstance(value, dict):
            _put_below(value, prefix)
        elif key == "Value" and isinstance(value, str) and value.startswith("/"):
            settings[key] = _below(value, prefix)


def _below(path: str, prefix: str) -> str:
    """A topic, maybe with a field, in a namespace.

    >>> _below("/mission_state.phase", "/robot_1"), _below("/diagnostics", "/robot_1")
    ('/robot_1/mission_state.phase', '/diagnostics')
    """
    first = re.split(r"[/.]", path.removeprefix("/"))[0]
    return path if first in OUTSIDE else prefix + path


def _base(topic: str) -> str:
    return topic.rpartition("/")[2]


def _view(field: Field) -> tuple[tuple[float, float], float]:
    """Centre of the field, and its longer side with a margin [m]."""
    low, high = field.polygon.min(axis=0), field.polygon.max(axis=0)
    x_m, y_m = ((low + high) / 2).tolist()
    return (x_m, y_m), field.extent_m


def _grid_step_m(field: Field) -> float:
    """Side of a cell of the reference grid [m]: 10, 100, ..."""
    reach_m = float(np.abs(field.polygon).max())
    return 10.0 * 10.0 ** max(0, math.ceil(math.log10(2 * reach_m / 10.0 / _LINES)))


def _grid_cells(field: Field, step_m: float) -> int:
    """Cells of a grid about the datum that covers the field: an even number."""
    return 2 * math.ceil(float(np.abs(field.polygon).max()) / step_m + 1)
