# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Models of configuration files, and all mistakes of a file at once."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from soilmoist_ros.foundation.configuration import read_yaml
from soilmoist_ros.foundation.errors import InputError, Mistake, did_you_mean

Model = TypeVar("Model", bound=BaseModel)
Location = tuple[int | str, ...]


_UNITS = {"hpa": "hPa", "gcm3": "g/cm3", "gm3": "g/m3", "gv": "GV", "cps": "counts/s", "mm": "mm", "hours": "h"}
"""Ends of keys, and the unit that they stand for."""


class Section(BaseModel):
    """Base class for every part of a configuration file: immutable, without unknown keys."""

    # Defer the build to the first use: a node reads fewer files than it imports models.
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


def load_model(path: Path, model: type[Model]) -> Model:
    """Read a YAML file into a model.

    :raises InputError: with line, key and remedy of every mistake in the file
    """
    content = read_yaml(path)
    if not isinstance(content, Mapping):
        raise InputError(
            f"should hold keys and values, but holds {_kind(content)}",
            f"the keys it may have are: {', '.join(model.model_fields)}",
            path,
        )
    try:
        return model.model_validate(_plain(content))
    except ValidationError as error:
        details: list[Any] = _without_consequences(error.errors())
        raise InputError([_as_mistake(detail, content, path, model) for detail in details]) from None


def _plain(node: Any) -> Any:
    """Convert the containers of the parser to plain dicts and lists."""
    if isinstance(node, Mapping):
        return {str(key): _plain(value) for key, value in node.items()}
    if isinstance(node, Sequence) and not isinstance(node, (str, bytes)):
        return [_plain(value) for value in node]
    if isinstance(node, float):
        return float(node)
    return node.isoformat() if isinstance(node, date) else node


def _without_consequences(details: Sequence[Any]) -> list[Any]:
    """Drop the errors of lists that are too short only because their items are wrong."""

    def is_consequence(detail: Any) -> bool:
        place = detail["loc"]
        return detail["type"] == "too_short" and any(
            len(other["loc"]) > len(place) and other["loc"][: len(place)] == place for other in details
        )

    return [detail for detail in details if not is_consequence(detail)]


def _as_mistake(detail: Any, content: Any, path: Path, model: type[BaseModel]) -> Mistake:
    location: Location = tuple(detail["loc"])
    message, remedy = _explained(detail, location, model)
    column = ".".join(str(part) for part in location if not _is_tag(part))
    return Mistake(message, remedy, path, line_of(content, location), column)


def _explained(detail: Any, location: Location, model: type[BaseModel]) -> tuple[str, str]:
    """Message and remedy of an error of pydantic."""
    kind, value, last = detail["type"], detail.get("input"), str(location[-1]) if location else ""
    if kind == "extra_forbidden":
        known = _known_keys(model, location[:-1])
        remedy = f"remove it or use one of: {', '.join(known)}{did_you_mean(last, known)}"
        if re.search("lat_?l(on|ng)", last.lower()):
            remedy += "; longitude comes first"
        if last.isdecimal():
            remedy = "write decimals with a point: 53.2, not 53,2"
        return f"unknown key {last!r}", remedy
    if kind == "missing":
        return f"the key {last!r} is missing", "add it"
    if kind == "model_type":
        known = _known_keys(model, location)
        shown = _kind(value) if value is None else f"{value!s:.60}"
        remedy = f"write its keys, such as {{{known[0]}: ...}}" if known else ""
        return f"should hold keys and values, but is {shown}", remedy
    message = detail["msg"].removeprefix("Value error, ").replace(" after validation", "")
    message = message.replace("valid tuple", "valid list").replace("Tuple should", "list should")
    message = message[:1].lower() + message[1:]
    if isinstance(value, (str, int, float)) and repr(value) not in message:
        message += f", but it is {value!r}"
    return message, _notation(kind, str(value).strip(), detail.get("ctx") or {}, last)


def _notation(kind: str, value: str, limits: Mapping[str, Any], key: str) -> str:
    """Remedy for a value in another notation or unit; empty if it is not clear."""
    end = key.rpartition("_")[2]
    unit = _UNITS.get(end, "")
    if key == "latitude_deg" and kind in ("greater_than_equal", "less_than_equal"):
        return "check whether latitude and longitude are swapped"
    if kind == "literal_error":
        known = re.findall(r"'([^']+)'", str(limits.get("expected")))
        return f"write {value.lower()}" if value.lower() in known else ""
    if kind == "too_long" and limits.get("max_length") == 2:
        return "write two values, such as [1, 2]"
    if kind in ("float_parsing", "int_parsing"):
        if end == "deg":
            return "write degrees with decimals and a point, south and west negative, such as 53.268"
        return f"write a number with a decimal point, without its unit{f', in {unit}' if unit else ''}"
    if not any(limits.get(one) for one in ("lt", "le", "gt", "ge")):  # zero has no unit
        return ""
    if 1.0 in (limits.get("lt"), limits.get("le")):
        return "it is a fraction: divide per cent by 100"
    return f"the name of the key has its unit: {'1/' * ('_per_' in key)}{unit}" if unit else ""


def _is_tag(part: int | str) -> bool:
    """True if a part of a location is the name of a union member, which pydantic adds and no file contains."""
    return isinstance(part, str) and bool(re.search(r"[\[(]|^function-|^[A-Z]\w+$", part))


def line_of(content: Any, location: Location) -> int:
    """Line, from 1, of the deepest part of a location that the file contains."""
    node, line = content, 0
    for part in location:
        marks = getattr(node, "lc", None)
        try:
            if isinstance(node, Mapping) and part in node:
                line = marks.key(part)[0] + 1  # type: ignore[union-attr]
            elif isinstance(node, Sequence) and isinstance(part, int):
                line = marks.item(part)[0] + 1  # type: ignore[union-attr]
            else:
                continue
            node = node[part]
        except (AttributeError, KeyError, IndexError, TypeError):
            break
    return line


def _known_keys(model: type[BaseModel], location: Location) -> list[str]:
    """Permitted keys of the part of the model at a location."""
    current: Any = model
    for part in location:
        if isinstance(part, int):
            continue
        fields = getattr(current, "model_fields", {})
        if part in fields:
            models = _models_in(fields[part].annotation)
            current = models[0] if models else None
        elif _models_in(current):
            continue
    return list(getattr(current, "model_fields", {}))


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for argument in get_args(annotation) for found in _models_in(argument)]


def _kind(content: Any) -> str:
    if content is None:
        return "nothing"
    return "a list" if isinstance(content, Sequence) and not isinstance(content, str) else "a single value"
