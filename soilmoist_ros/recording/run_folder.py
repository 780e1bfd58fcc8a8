# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The folder of a run: the bag, and the parameters and configuration files of its nodes.

::

    RUN/bag/                          the recording, in the rosbag2 layout
    RUN/configuration/NODE.yaml       parameters of each node
    RUN/configuration/field.yaml ...  the files that they name

A single bag from the recorder of a robot is also a run: the configuration is in the bag's folder.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.whole_file import write_whole

BAG = "bag"
BAG_FILES = (".mcap", ".db3", ".bag")
"""Endings of files with messages: of ROS 2, and of ROS 1."""
SUMMARY = "summary.json"
"""All figures of a run that was mapped, for programs."""
CONFIGURATION = "configuration"
_PARAMETERS = "ros__parameters"


def write_parameters(run: Path, node: str, values: Mapping[str, object]) -> Path:
    """Write the parameters of a node, as ``--params-file`` reads them.

    :param run: folder of the run
    :param node: name of the node, after the namespace of a further property: ``compaction/mapper``
    :param values: parameters by name: numbers, texts, truth values, lists of texts
    :returns: the file
    :raises InputError: if it cannot be written
    """
    path = run / CONFIGURATION / f"{node}.yaml"
    lines = [f"/**/{node}:", f"  {_PARAMETERS}:{'' if values else ' {}'}"]
    lines += [f"    {name}: {_yaml(value)}" for name, value in values.items()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, ("\n".join(lines) + "\n").encode())
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another output folder", path) from None
    return path


def bag_of(path: Path) -> Path:
    """The bag of a run, from the folder of the run or the bag itself."""
    return path / BAG if (path / BAG).is_dir() else path


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: a file of one, or a folder with several."""
    return path.suffix in BAG_FILES or (path / "metadata.yaml").is_file() or any(path.glob("*.bag"))


def message_files(bag: Path) -> list[Path]:
    """The files with the messages of a bag, including compressed files.

    :param bag: folder of the bag, or its only file
    """
    if not bag.is_dir():
        return [bag]
    return [path for path in sorted(bag.iterdir()) if set(BAG_FILES) & set(path.suffixes)]


def configuration_of(bag: Path) -> Path | None:
    """The folder with the configuration of a bag, in the bag's folder or next to it; ``None`` if there is none.

    :param bag: the folder of a bag, or a file in it
    """
    home = bag.absolute() if bag.is_dir() else bag.absolute().parent
    for folder in (home, home.parent):
        if (folder / CONFIGURATION).is_dir():
            return folder / CONFIGURATION
    return None


def copy_configuration(bag: Path, target: Path) -> None:
    """Copy the configuration of a bag, if there is one, into another bag.

    :param bag: folder of the bag, or a file in it
    :param target: folder of the other
    :raises InputError: if it cannot be written
    """
    configuration = configuration_of(bag)
    if configuration is None:
        return
    try:
        shutil.copytree(configuration, target / CONFIGURATION, dirs_exist_ok=True)
    except OSError as error:
        raise InputError(f"the configuration cannot be copied: {error}", "copy it by hand", target) from None


def read_parameters(configuration: Path | None, node: str) -> dict[str, Any]:
    """Parameters of a node as :func:`write_parameters` wrote them, empty if there are none.

    Names of files that are in the configuration folder become paths in it, since a run folder may be moved.

    :param configuration: folder of the configuration
    :param node: name of the node
    :raises InputError: if the file exists but is not a file of parameters
    """
    path = (configuration or Path()) / f"{node}.yaml"
    if configuration is None or not path.is_file():
        return {}
    from soilmoist_ros.foundation import read_yaml

    content = read_yaml(path)
    try:
        values = dict(next(iter(content.values()))[_PARAMETERS])
    except (AttributeError, KeyError, StopIteration, TypeError):
        raise InputError("is not a file of node parameters", "restore the recorded file", path) from None
    for name, value in values.items():
        if isinstance(value, float):
            values[name] = float(value)  # the parser's type keeps the notation of the number
        elif isinstance(value, str) and "/" in value and (configuration / Path(value).name).is_file():
            values[name] = str(configuration / Path(value).name)
    return values


def _yaml(value: object) -> str:
    """JSON is YAML as well, except for numbers that JSON cannot express."""
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else f"{'-' if value < 0 else ''}.inf"
    return json.dumps(value, ensure_ascii=False)
