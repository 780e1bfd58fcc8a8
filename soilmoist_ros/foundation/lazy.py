"""Load the public names of a folder on first use, which keeps ``import soilmoist_ros.sensing`` light."""

from __future__ import annotations

import ast
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


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
