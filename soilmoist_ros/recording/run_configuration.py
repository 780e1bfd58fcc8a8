# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Stores the configuration of the nodes with a recording: their parameters, and copies of the files they name."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Final

from soilmoist_ros.foundation import InputError
from soilmoist_ros.recording.run_folder import BAG, CONFIGURATION, read_parameters, write_parameters
from soilmoist_ros.recording.whole_file import write_whole

_KINDS: Final = {"field": "fields", "site": "sites", "graph": "graphs", "logger_format": "loggers"}
"""Parameters that name a file, and the folders of the shipped files."""
_NAMED: Final = {"field": ("geojson",), "site": ("corrections", "intensity", "file")}
"""Keys of these files that name another file, by a relative path."""

_CHOSEN: Final = ("field", "earlier", "covariates")
"""Parameters that an operator may choose while the nodes run."""


class RunConfiguration:
    """Writes the configuration of each recording.

    Existing files stay, unless an operator chooses another field: the program that started the nodes wrote them.
    What they lack is added: the parameters that the nodes had by default.
    """

    def __init__(self) -> None:
        self._nodes: dict[str, dict[str, object]] = {}
        self._written: dict[str, dict[str, object]] = {}
        self._others: dict[str, dict[str, object]] = {}
        self._bag: Path | None = None

    def take(self, node: str, values: Mapping[str, object]) -> None:
        """Set the parameters of a node.

        :param node: its name, after its namespace if the namespace differs from the recorder's
        :param values: values by name
        """
        self._nodes[node.strip("/")] = dict(values)

    def write(self, bag: Path) -> list[str]:
        """Write what is new for this recording.

        :param bag: its folder
        :returns: nodes whose parameters were written
        :raises InputError: if a file cannot be written; the next call tries again
        """
        if bag != self._bag:
            self._bag, self._written, self._others = bag, {}, {}
        run = _run_of(bag)
        done = []
        for node, values in list(self._nodes.items()):
            known = self._written.get(node)
            if known == values:
                continue
            if known is None and (run / CONFIGURATION / f"{node}.yaml").exists():
                first = self._others.get(node)
                if first is None:
                    done += [node] if _complete(run, node, values) else []
                    self._others[node] = values
                    continue
                if all(first.get(name) == values.get(name) for name in _CHOSEN):
                    continue
            kept = {name: _keep(run / CONFIGURATION, node, name, value) for name, value in values.items()}
            write_parameters(run, node, kept)
            self._written[node] = values
            done.append(node)
        return done


def _complete(run: Path, node: str, values: Mapping[str, object]) -> bool:
    """Add what a file of parameters lacks, and the node had by default; returns whether something was added.

    Without it, a later version with other defaults would read the file otherwise.
    """
    try:
        had = read_parameters(run / CONFIGURATION, node)
    except InputError:  # not a file of parameters
        return False
    missing = {name: value for name, value in values.items() if name not in had}
    if missing:
        kept = {name: _keep(run / CONFIGURATION, node, name, value) for name, value in missing.items()}
        write_parameters(run, node, {**had, **kept})
    return bool(missing)


def _run_of(bag: Path) -> Path:
    """The folder for the configuration: the run's folder if there is one, else the bag."""
    return bag.parent if bag.name == BAG and (bag.parent / CONFIGURATION).is_dir() else bag


def _keep(folder: Path, node: str, parameter: str, value: object) -> object:
    """Copy the file that a parameter names, and return the value that names the copy.

    Nodes that name the same file share a copy.
    """
    if parameter not in _KINDS or not isinstance(value, str) or not value:
        return value
    source = _file_of(parameter, value)
    if source is None:
        return value
    for stem in (parameter, f"{node.replace('/', '_')}_{parameter}"):
        copies = _copies(source, parameter, stem)
        free = all(_content(folder / name) in (None, content) for name, content in copies.items())
        if free or stem != parameter:
            break
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
    """Contents of the copies by name: the file, and the file that it names.

    :raises InputError: if the file cannot be read
    """
    from ruamel.yaml import YAML

    from soilmoist_ros.foundation import read_yaml

    content = _content(source)
    if content is None:
        raise InputError("cannot be read any more", "check the path and its permissions", source)
    own = {f"{stem}{source.suffix}": content}
    *path, key = _NAMED.get(parameter, ("",))
    try:
        tree = section = read_yaml(source)
        for name in path:
            section = section[name]
        named = source.parent / section[key]
    except (InputError, KeyError, TypeError):
        return own
    other = _content(named)
    if other is None:
        return own
    section[key] = f"{stem}_{named.name}"
    text = StringIO()
    YAML(typ="rt").dump(tree, text)  # with its comments
    return {f"{stem}{source.suffix}": text.getvalue().encode(), section[key]: other}


def _content(path: Path) -> bytes | None:
    """Content of a file, ``None`` if it does not exist or cannot be read."""
    try:
        return path.read_bytes()
    except OSError:
        return None
