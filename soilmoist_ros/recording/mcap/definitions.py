# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Definitions of message types, read from the files of a ROS installation; ROS is not imported."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from soilmoist_ros.foundation import InputError

_SEPARATOR: Final = "=" * 80
_PRIMITIVE: Final = re.compile(r"bool|byte|char|float(32|64)|u?int(8|16|32|64)|w?string")
_FIELD: Final = re.compile(r"^\s*([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[A-Za-z]\w*")
_MAX_FIELDS: Final = 100_000
_TYPE: Final = re.compile(r"(\w+)/msg/(\w+)")


@dataclass(frozen=True)
class Definition:
    """Definition of a message type, as a reader needs it.

    :param type_name: name as in ``std_msgs/msg/String``
    :param text: definition, followed by the definitions of all types in it
    :param encoding: ``ros2msg``; bags of other recorders may have ``ros2idl``
    :param type_hash: hash of the type (``RIHS01_...``), empty if unknown
    """

    type_name: str
    text: str
    encoding: str = "ros2msg"
    type_hash: str = ""


def search_prefixes() -> list[Path]:
    """Folders in which ROS packages may be installed: those of ``AMENT_PREFIX_PATH``, then this Python's."""
    named = [Path(entry) for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]
    return list(dict.fromkeys([*named, Path(sys.prefix)]))


def find_definition(type_name: str, prefixes: Sequence[Path] | None = None) -> Definition:
    """Definition of a message type, with the definitions of all types in it.

    :param type_name: name as in ``std_msgs/msg/String``
    :param prefixes: folders to search; :func:`search_prefixes` if ``None``
    :raises InputError: if the type, or a type in it, is not installed
    """
    where = search_prefixes() if prefixes is None else prefixes
    path = _find(type_name, where)
    parts = [path.read_text(encoding="utf-8")]
    seen = {type_name}
    waiting = _used_types(parts[0], type_name)
    while waiting:
        name = waiting.pop(0)
        if name in seen:
            continue
        seen.add(name)
        text = _find(name, where).read_text(encoding="utf-8")
        package, _, kind = name.split("/")
        parts += [_SEPARATOR, f"MSG: {package}/{kind}", text]
        waiting += _used_types(text, name)
    return Definition(type_name, "\n".join(parts), type_hash=_type_hash(path, type_name))


def _find(type_name: str, prefixes: Sequence[Path]) -> Path:
    match = _TYPE.fullmatch(type_name)
    if match is None:
        raise InputError(f"{type_name!r} is not the name of a message type", "names look like std_msgs/msg/String")
    for prefix in prefixes:
        path = prefix / "share" / match[1] / "msg" / f"{match[2]}.msg"
        if path.is_file():
            return path
    raise InputError(
        f"the definition of {type_name} is not installed (looked in: {', '.join(map(str, prefixes))})",
        f"install the ROS package {match[1]}, or add its prefix to AMENT_PREFIX_PATH",
    )


def _used_types(text: str, type_name: str) -> list[str]:
    """Full names of the types of a definition's fields; names without a package get the definition's."""
    package = type_name.split("/")[0]
    found = []
    for line in text.splitlines():
        match = _FIELD.match(line.partition("#")[0])
        if match is None or _PRIMITIVE.fullmatch(match[1]):
            continue
        *folders, kind = match[1].split("/")
        found.append(f"{folders[0] if folders else package}/msg/{kind}")
    return found


def _type_hash(path: Path, type_name: str) -> str:
    try:
        entries = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))["type_hashes"]
        return next(str(entry["hash_string"]) for entry in entries if entry["type_name"] == type_name)
    except (OSError, ValueError, KeyError, TypeError, StopIteration):
        return ""  # distributions before Iron have none


def require_small(types: Mapping[str, Any], names: Iterable[str]) -> None:
    """Refuse types with very many fields: rosbags writes code for each element of a fixed array, and runs it."""
    from rosbags.interfaces import Nodetype  # light: the recorder imports this module

    sizes: dict[str, int] = {}

    def fields_of(name: str) -> int:
        if name not in sizes:
            sizes[name] = max(1, sum(parts_of(*description) for _, description in types[name][1]))
            if sizes[name] > _MAX_FIELDS:
                raise ValueError(f"a {name} would have more than {_MAX_FIELDS:,} fields")
        return sizes[name]

    def parts_of(kind: Nodetype, about: Any) -> int:
        if kind == Nodetype.NAME:
            return fields_of(about)
        if kind == Nodetype.BASE:
            return 1
        (inner, detail), length = about
        if inner == Nodetype.BASE and detail[0] != "string":
            return 1  # numbers are one numpy array, and need their bytes in the message
        one = parts_of(inner, detail)
        return int(length) * one if kind == Nodetype.ARRAY else one

    for name in names:
        fields_of(name)
