# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Find and read configuration files, and report all their mistakes at once."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any, Final, Literal, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent

from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.foundation.suggestions import did_you_mean

Model = TypeVar("Model", bound=BaseModel)
Location = tuple[int | str, ...]

_MAX_YAML_BYTES: Final = 2_000_000
_MAX_YAML_DEPTH: Final = 100
_MAX_YAML_VALUES: Final = 100_000
"""Values of a file, where each alias counts as all that it stands for; reading them takes a few seconds."""


class Section(BaseModel):
    """Base class for every part of a configuration file: immutable, without unknown keys."""

    # Defer the build to the first use: a node reads fewer files than it imports models.
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


def config_folder() -> Path:
    """The ``config`` folder of the source tree, otherwise of ``share/soilmoist_ros``.

    :raises InputError: if the package was installed without its data files
    """
    package = Path(__file__).resolve().parent
    for parent in package.parents:
        for folder in (parent / "config", parent / "share" / "soilmoist_ros" / "config"):
            if (folder / "loggers").is_dir():
                return folder
    raise InputError(
        "the config folder of soilmoist_ros is not installed",
        "install the package again with pip or colcon (copying only the Python files is not enough)",
        package,
    )


def resource_names(kind: str) -> list[str]:
    """Names of the shipped files of one kind (a sub-folder of ``config``), sorted."""
    return sorted(path.stem for path in (config_folder() / kind).glob("*.yaml"))


def resource(kind: str, name: str) -> Path:
    """Path of a configuration file given as a path or as the name of a shipped one.

    :param kind: sub-folder of ``config``, such as ``loggers``
    :param name: path to a file, or the name of a shipped file without ``.yaml``
    :raises InputError: if neither exists; lists the shipped names
    """
    path = Path(name)
    if path.is_file():
        return path
    shipped = config_folder() / kind / f"{name}.yaml"
    if re.fullmatch(r"[\w.-]+", name) and shipped.is_file():
        return shipped
    known = resource_names(kind)
    if not name:
        message = f"no {kind.removesuffix('s')} is given"
        raise InputError(message, f"give the path of a YAML file or one of: {', '.join(known)}")
    raise InputError(
        f"there is no file and no shipped {kind.removesuffix('s')} of the name {name!r}",
        f"give the path of a YAML file or one of: {', '.join(known)}{did_you_mean(name, known)}",
    )


def read_yaml(path: Path) -> Any:
    """The content of a YAML file, with the line numbers that :func:`load_model` reports.

    :raises InputError: if the file cannot be read or is not valid YAML
    """
    try:
        with path.open("rb") as file:
            data = file.read(_MAX_YAML_BYTES + 1)
        text = data.decode("utf-8-sig") if len(data) <= _MAX_YAML_BYTES else " " * len(data)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", "check the path and its permissions", path) from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"is not UTF-8 text (byte {error.start})", "save the file as UTF-8 in a text editor", path
        ) from None
    return parse_yaml(text, path, "rt")


def parse_yaml(text: str, path: Path | None = None, kind: Literal["safe", "rt"] = "safe") -> Any:
    """The content of a YAML text, which may come from a stranger: size, depth and aliases have limits.

    :param text: at most 2 MB, 100 levels, and 100 000 values where an alias counts as all that it stands for
    :param path: where the text comes from, for the message
    :param kind: ``safe`` for plain data, ``rt`` for data that know their lines and comments
    :raises InputError: if it is not valid YAML, or beyond a limit
    """
    if len(text) > _MAX_YAML_BYTES:
        raise InputError(f"is larger than {_MAX_YAML_BYTES / 1e6:g} MB of YAML", "give a smaller file", path)
    yaml = YAML(typ=kind)
    yaml.Composer = _LimitedComposer
    try:
        return yaml.load(StringIO(text))
    except MarkedYAMLError as error:
        mark = error.problem_mark
        mistake = Mistake(
            f"is not valid YAML: {error.problem}",
            "check indentation, colons and quotes near this line; use spaces, not tabs",
            path,
            mark.line + 1 if mark else 0,
        )
        raise InputError([mistake]) from None
    except (YAMLError, ValueError, TypeError, AttributeError, AssertionError, RecursionError) as error:
        raise InputError(f"is not valid YAML: {error}", "open it in a text editor and repair it", path) from None


class _LimitedComposer(Composer):
    """Counts values, so that a few lines of aliases of aliases do not become billions of values."""

    def __init__(self, loader: Any = None) -> None:
        super().__init__(loader)
        self.warn_double_anchors = False
        self._values = 0
        self._sizes: dict[str | None, int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.parser.peek_event()
        before = self._values
        alias = isinstance(event, AliasEvent)
        if alias and event.anchor in self.anchors:  # inside itself it has no size yet, and would have no end
            self._values += self._sizes.get(event.anchor, _MAX_YAML_VALUES)
        self._values += 1
        for number, limit, what in (
            (self._values, _MAX_YAML_VALUES, "values"),
            (self.depth, _MAX_YAML_DEPTH, "levels"),
        ):
            if number > limit:
                raise MarkedYAMLError(problem=f"more than {limit} {what}", problem_mark=event.start_mark)
        if not alias:
            self._sizes.pop(event.anchor, None)
        node = super().compose_node(parent, index)
        if not alias:
            self._sizes[event.anchor] = self._values - before
        return node


def load_model(path: Path, model: type[Model]) -> Model:
    """Read a YAML file into a model.

    :param path: file to read
    :param model: pydantic model that describes it
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
    return node


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
    column = ".".join(str(part) for part in location if not _is_tag(part, content))
    line = line_of(content, location)
    if detail["type"] == "extra_forbidden":
        known = _known_keys(model, location[:-1])
        unknown = str(location[-1])
        remedy = f"remove it or use one of: {', '.join(known)}{did_you_mean(unknown, known)}"
        return Mistake(f"unknown key {unknown!r}", remedy, path, line, column)
    if detail["type"] == "missing":
        return Mistake(f"the key {location[-1]!r} is missing", "add it", path, line, column)
    message = detail["msg"].removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    value = detail.get("input")
    if isinstance(value, (str, int, float)) and repr(value) not in message:
        message += f", but it is {value!r}"
    return Mistake(message, "", path, line, column)


def _is_tag(part: int | str, content: Any) -> bool:
    """Whether a part of a location is the name of a union member, which pydantic adds and no file contains."""
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
