"""Modules that are imported on first use: ``import soilmoist_ros.sensing`` is light, and extras may be missing."""

from __future__ import annotations

import ast
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from soilmoist_ros.foundation.errors import InputError


def load_on_use(package: str, file: str) -> Callable[[str], Any]:
    """A module's ``__getattr__`` that imports what the file imports under ``if TYPE_CHECKING``.

    Type checkers and readers see plain imports; Python runs an import when its name is first used.

    :param package: ``__name__`` of the package
    :param file: ``__file__`` of its ``__init__``
    """

    @cache
    def homes() -> dict[str, str]:
        blocks = [
            node for node in ast.parse(Path(file).read_text(encoding="utf-8")).body if isinstance(node, ast.If)
        ]
        imports = [node for block in blocks for node in block.body if isinstance(node, ast.ImportFrom)]
        return {alias.name: node.module or "" for node in imports for alias in node.names}

    def load(name: str) -> Any:
        # Python looks up names such as __path__, which no file defines; skip reading the file for them.
        if name.startswith("__") or name not in homes():
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(homes()[name]), name)

    return load


def optional_module(name: str, extra: str) -> Any:
    """A module of an optional extra of this package.

    :param name: name of the module
    :param extra: name of the extra that installs it
    :raises InputError: if it is not installed; states how to install it

    >>> optional_module("absent", "frames")
    Traceback (most recent call last):
    ...
    soilmoist_ros.foundation.errors.InputError: absent is not installed -> pip install "soilmoist_ros[frames]"
    """
    try:
        return import_module(name)
    except ImportError:
        raise InputError(f"{name} is not installed", f'pip install "soilmoist_ros[{extra}]"') from None
