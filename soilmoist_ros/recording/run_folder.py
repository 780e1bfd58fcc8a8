"""The folder of a run: the bag, and beside it the parameters and configuration files that it was made with.

::

    RUN/bag/                          the recording, in the rosbag2 layout
    RUN/configuration/NODE.yaml       parameters of each node
    RUN/configuration/field.yaml ...  the files that they name

A bag by itself, as the recorder makes it on a robot, is a run as well: it has its configuration in it.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from soilmoist_ros.foundation.configuration import read_yaml
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.recording.whole_file import write_whole

BAG = "bag"
CONFIGURATION = "configuration"
_PARAMETERS = "ros__parameters"


def write_parameters(run: Path, node: str, values: Mapping[str, object]) -> Path:
    """Write the parameters of a node, as ``--params-file`` takes them.

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
    """The bag of a run, given the folder of the run or the bag itself."""
    return path / BAG if (path / BAG).is_dir() else path


def configuration_of(bag: Path) -> Path | None:
    """The folder with the configuration of a bag: in it, or beside it; ``None`` without.

    :param bag: the folder of a bag, or a file in it
    """
    home = bag.absolute() if bag.is_dir() else bag.absolute().parent
    for folder in (home, home.parent):
        if (folder / CONFIGURATION).is_dir():
            return folder / CONFIGURATION
    return None


def copy_configuration(bag: Path, target: Path) -> None:
    """Copy the configuration of a bag into another one, if there is one.

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

    Names of files that are in the configuration folder come out as paths in it: a run folder may be moved.

    :param configuration: folder of the configuration
    :param node: name of the node
    :raises InputError: if the file is there but is no file of parameters
    """
    path = (configuration or Path()) / f"{node}.yaml"
    if configuration is None or not path.is_file():
        return {}
    content = read_yaml(path)
    try:
        values = dict(next(iter(content.values()))[_PARAMETERS])
    except (AttributeError, KeyError, StopIteration, TypeError):
        raise InputError("is no file of node parameters", "leave it as it was recorded", path) from None
    for name, value in values.items():
        if isinstance(value, float):
            values[name] = float(value)  # without what the parser remembers of how it was written
        elif isinstance(value, str) and "/" in value and (configuration / Path(value).name).is_file():
            values[name] = str(configuration / Path(value).name)
    return values


def _yaml(value: object) -> str:
    """JSON is YAML as well, but for the numbers that it has no word for."""
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else f"{'-' if value < 0 else ''}.inf"
    return json.dumps(value, ensure_ascii=False)
