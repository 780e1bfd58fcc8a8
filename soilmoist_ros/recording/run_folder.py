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
import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.foundation import InputError

BAG = "bag"
BAG_FILES = (".mcap", ".db3", ".bag")  # endings of files with messages: of ROS 2, and of ROS 1
SUMMARY = "summary.json"
"""All figures of a run that was mapped, for programs."""
CONFIGURATION = "configuration"
_PARAMETERS = "ros__parameters"
_KINDS: Final = {"field": "fields", "site": "sites", "graph": "graphs", "logger_format": "loggers"}
"""Parameters that name a file, and the folders of the shipped files."""
_NAMED: Final = {"field": ("geojson",), "site": ("corrections", "intensity", "file")}
"""Keys of these files that name another file, by a relative path."""


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that a crash leaves all of the new content, or none of it.

    :raises OSError: if it cannot be written
    """
    temporary = path.with_name(f"{path.name}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError:  # of a full disk, which what is half written would keep full
        temporary.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def sync_file(path: Path) -> None:
    """Make sure that the content of a file is on the disk."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Make sure that the names of a folder's files are on the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_parameters(run: Path, node: str, values: Mapping[str, object]) -> Path:
    """Write the parameters of a node into the folder of a run, as ``--params-file`` reads them; returns the file.

    :param node: name of the node, after the namespace of a further property: ``compaction/mapper``
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
    """True if a path is a bag: a file of one, or a folder with several."""
    return path.suffix in BAG_FILES or (path / "metadata.yaml").is_file() or any(path.glob("*.bag"))


def message_files(bag: Path) -> list[Path]:
    """The files with the messages of a bag (a folder, or its only file), including compressed files."""
    if not bag.is_dir():
        return [bag]
    return [path for path in sorted(bag.iterdir()) if set(BAG_FILES) & set(path.suffixes)]


def configuration_of(bag: Path) -> Path | None:
    """The folder with the configuration of a bag, or of a file in it; in the bag's folder or next to it."""
    home = bag.absolute() if bag.is_dir() else bag.absolute().parent
    places = (folder / CONFIGURATION for folder in (home, home.parent))
    return next((place for place in places if place.is_dir()), None)


def copy_configuration(bag: Path, target: Path) -> None:
    """Copy the configuration of a bag, if there is one, into the folder of another bag.

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


class RunConfiguration:
    """Writes the parameters of the running nodes, and the files that they name, for each recording."""

    def __init__(self) -> None:
        self._nodes: dict[str, dict[str, object]] = {}
        self._written: dict[str, dict[str, object]] = {}
        self._bag: Path | None = None

    def take(self, node: str, values: Mapping[str, object]) -> None:
        """Set the parameters of a node, named with its namespace if that differs from the recorder's."""
        self._nodes[node.strip("/")] = dict(values)

    def write(self, bag: Path) -> list[str]:
        """Write what is new for this recording, and return the nodes whose parameters were written."""
        if bag != self._bag:
            self._bag, self._written = bag, {}
        in_run = bag.name == BAG and (bag.parent / CONFIGURATION).is_dir()
        run, done = bag.parent if in_run else bag, []
        for node, values in list(self._nodes.items()):
            if self._written.get(node) != values:
                kept = {name: _keep(run / CONFIGURATION, node, name, value) for name, value in values.items()}
                write_parameters(run, node, kept)
                self._written[node] = values
                done.append(node)
        return done


def _keep(folder: Path, node: str, parameter: str, value: object) -> object:
    """Copy the file that a parameter names, and return the value that names the copy, which nodes may share."""
    if parameter not in _KINDS or not isinstance(value, str) or not value:
        return value
    source = _file_of(parameter, value)
    if source is None:
        return value
    copies = _copies(source, parameter, parameter)
    if any(_content(folder / name) not in (None, content) for name, content in copies.items()):
        copies = _copies(source, parameter, f"{node.replace('/', '_')}_{parameter}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in copies.items():
            if _content(folder / name) != content:
                write_whole(folder / name, content)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "make space on the disk", folder) from None
    return str((folder / next(iter(copies))).absolute())


def _file_of(parameter: str, value: str) -> Path | None:
    """The file that a parameter names, if it is on this computer."""
    from soilmoist_ros.foundation import resource

    with suppress(InputError):
        return resource(_KINDS[parameter], value)
    if parameter == "logger_format":
        from soilmoist_ros.sensing import logger_path

        with suppress(InputError):
            return logger_path(value)
    return None


def _copies(source: Path, parameter: str, stem: str) -> dict[str, bytes]:
    """Contents of the copies by name: the file, and the file that it names; ``InputError`` if unreadable."""
    from ruamel.yaml import YAML

    from soilmoist_ros.foundation import read_yaml

    content = _content(source)
    if content is None:
        raise InputError("cannot be read any more", "check the path and its permissions", source)
    name = f"{stem}{source.suffix}"
    own = {name: content}
    *path, key = _NAMED.get(parameter, ("",))
    try:
        tree = section = read_yaml(source)
        for part in path:
            section = section[part]
        named = source.parent / section[key]
    except (InputError, KeyError, TypeError):
        return own
    other = _content(named)
    if other is None:
        return own
    section[key] = f"{stem}_{named.name}"
    text = StringIO()
    YAML(typ="rt").dump(tree, text)  # with its comments
    return {name: text.getvalue().encode(), section[key]: other}


def _content(path: Path) -> bytes | None:
    """Content of a file, ``None`` if it does not exist or cannot be read."""
    try:
        return path.read_bytes()
    except OSError:
        return None
