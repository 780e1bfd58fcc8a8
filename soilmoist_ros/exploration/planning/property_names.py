# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Names of further properties, used for their ROS namespaces and files."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from soilmoist_ros.foundation import InputError

_WORD: Final = "[A-Za-z_][A-Za-z0-9_]*"
_NAMESPACE: Final = re.compile(rf"/?{_WORD}(/{_WORD})*/*")
_FILES: Final = (".yaml", ".yml")


def property_weights(texts: Iterable[str]) -> dict[str, float]:
    """Namespaces of further properties, each with its weight.

    :param texts: ``NAMESPACE`` or ``NAMESPACE:WEIGHT``; names without a leading / are below the robot's
    :raises InputError: if a text has no valid namespace, or its weight is not a number from 0
    """
    found = {}
    for text in texts:
        name, colon, number = text.partition(":")
        try:
            if not _NAMESPACE.fullmatch(name):
                raise ValueError("words of letters, digits and _ with / between them")
            weight = float(number) if colon else 1.0
            if not (math.isfinite(weight) and weight >= 0):
                raise ValueError("the weight must be 0 or more")
        except ValueError as error:
            remedy = "give such as /compaction or /compaction:0.5"
            raise InputError(f"properties: {text!r} is not a namespace with a weight ({error})", remedy) from None
        found[name.rstrip("/")] = weight
    return found


def property_name(field: str) -> str:
    """Name of the property that a surrogate field simulates.

    :param field: name of the field, or the path of its file
    :returns: letters, digits and _, as ROS requires, such as ``synthetic_low`` of ``synthetic-low``
    """
    path = Path(field)
    text = path.stem if path.suffix in _FILES else path.name
    name = re.sub("[^A-Za-z0-9]+", "_", text).strip("_")
    return name if re.fullmatch(_WORD, name) else f"property_{name}".rstrip("_")
