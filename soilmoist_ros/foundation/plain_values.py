"""Values that JSON has words for."""

from __future__ import annotations

import math
from typing import Any


def nan_as_text(value: Any) -> Any:
    """The value with NaN and infinity as text, which reads back as a number: JSON has no word for them."""
    if isinstance(value, dict):
        return {key: nan_as_text(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [nan_as_text(item) for item in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
