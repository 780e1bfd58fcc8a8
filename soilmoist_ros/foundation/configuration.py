# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Find configuration files, and read YAML that may come from a stranger."""

from __future__ import annotations

import re
import stat
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any, Final, Literal

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError

from soilmoist_ros.foundation.errors import InputError, Mistake, did_you_mean

_MAX_BYTES: Final = 50_000_000
_MAX_YAML_BYTES: Final = 2_000_000
_MAX_YAML_DEPTH: Final = 100
_MAX_YAML_VALUES: Final = 100_000
"""Values of a file, where each alias counts as all that it stands for; reading them takes a few seconds."""


@cache
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


def read_limited(path: Path, remedy: str = "check the path and its permissions", limit: int = _MAX_BYTES) -> bytes:
    """The content of a file that may come from a stranger, or that a file of a stranger names.

    :raises InputError: if it cannot be read, is larger, or is no regular file: a device or a pipe may have no end
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise InputError("cannot be read: it is not a regular file", remedy, path)
        with path.open("rb") as file:
            data = file.read(limit + 1)
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read: {reason}", remedy, path) from None
    if len(data) > limit:
        raise InputError(f"is larger than {limit / 1e6:g} MB", "give a smaller file", path)
    return data


def read_lines(path: Path, remedy: str = "check the path and its permissions") -> list[str]:
    """Lines of a text table of any program: UTF-8, UTF-16 with a byte order mark, else Latin-1.

    :raises InputError: if it cannot be read, or is a spreadsheet
    """
    data = read_limited(path, remedy)
    if data.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        raise InputError("is a spreadsheet or an archive, not text", "save the table as CSV (UTF-8)", path)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace").splitlines()
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\0", "").splitlines()


def read_yaml(path: Path) -> Any:
    """The content of a YAML file, with the line numbers that :func:`load_model` reports.

    :raises InputError: if the file cannot be read, is beyond a limit, or is not valid YAML
    """
    try:
        text = read_limited(path, limit=_MAX_YAML_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"is not UTF-8 text (byte {error.start})", "save the file as UTF-8 in a text editor", path
        ) from None
    return parse_yaml(text, path, "rt")


def parse_yaml(
    text: str,
    path: Path | None = None,
    kind: Literal["safe", "rt"] = "safe",
    max_bytes: int = _MAX_YAML_BYTES,
    max_values: int = _MAX_YAML_VALUES,
) -> Any:
    """The content of a YAML text, which may come from a stranger: size, depth and aliases have limits.

    :raises InputError: if it is not valid YAML, or beyond a limit
    """
    if len(text) > max_bytes:
        raise InputError(f"is larger than {max_bytes / 1e6:g} MB of YAML", "give a smaller file", path)
    yaml = YAML(typ=kind)
    yaml.composer.warn_double_anchors = False
    try:
        _require_limits(YAML(typ=kind).parse(StringIO(text)), max_values)
        return yaml.load(StringIO(text))
    except _TooLargeError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 0
        remedy = "give a smaller file, or one with fewer aliases (*NAME)"
        raise InputError([Mistake(f"holds {error.problem}", remedy, path, line)]) from None
    except MarkedYAMLError as error:
        mark = error.problem_mark
        mistake = Mistake(
            f"is not valid YAML: {error.problem}",
            "remove one of the two"
            if "duplicate key" in str(error.problem)
            else "check indentation, colons and quotes near this line; use spaces, not tabs",
            path,
            mark.line + 1 if mark else 0,
        )
        raise InputError([mistake]) from None
    except Exception as error:  # the parser has many for damaged text
        raise InputError(f"is not valid YAML: {error}", "open it in a text editor and repair it", path) from None


def read_quickly(text: str, max_values: int) -> Any:
    """The content of a YAML text as the C parser of PyYAML reads it, some ten times as fast as :func:`parse_yaml`.

    :returns: plain data; ``None`` where the parser is not installed, or the text has a fault or is beyond a limit:
        :func:`parse_yaml` names that with its line
    """
    try:
        yaml: Any = import_module("yaml")
        parser = yaml.CSafeLoader
    except (ImportError, AttributeError):
        return None

    class Loader(parser):  # type: ignore[misc, valid-type]
        """Refuses keys that are there twice, of which PyYAML takes the last."""

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            keys = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
            if len(set(keys)) < len(keys):
                raise yaml.YAMLError
            return super().construct_mapping(node, deep)

    try:
        _require_limits(yaml.parse(text, parser), max_values)
        return yaml.load(text, Loader)
    except Exception:  # the parser has many for damaged text
        return None


class _TooLargeError(MarkedYAMLError):
    """A YAML text is beyond a limit."""


def _require_limits(events: Iterable[Any], max_values: int) -> None:
    """Count the values of a text by its events, which ruamel.yaml and PyYAML name alike.

    A few lines of aliases of aliases could become billions of values, and a deep text would end the process, since
    what follows recurses.

    :raises _TooLargeError: if the text is beyond a limit
    """
    values, sizes, begun = 0, dict[str | None, int](), list[tuple[str | None, int]]()
    for event in events:
        kind = type(event).__name__
        if kind in ("SequenceEndEvent", "MappingEndEvent"):
            anchor, before = begun.pop()
            sizes[anchor] = values - before
        elif kind in ("SequenceStartEvent", "MappingStartEvent"):
            begun.append((event.anchor, values))
            sizes[event.anchor] = max_values  # inside itself it would have no end
            values += 1
        elif kind == "ScalarEvent":
            sizes[event.anchor] = 1
            values += 1
        elif kind == "AliasEvent":
            values += sizes.get(event.anchor, 0) + 1
        for number, limit, what in ((values, max_values, "values"), (len(begun), _MAX_YAML_DEPTH, "levels")):
            if number > limit:
                raise _TooLargeError(problem=f"more than {limit} {what}", problem_mark=event.start_mark)
