# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Memory of processes that last for weeks."""

from __future__ import annotations

import ctypes
from typing import Final

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Names in ``malloc.h`` of the limits below."""
_KEPT_BYTES: Final = 2 << 20
"""Free memory at the end of a heap above which it goes back to the system [bytes]."""
_MAPPED_BYTES: Final = 1 << 20
"""Size from which an array has memory of its own, which goes back when it is freed [bytes]."""


def return_memory() -> bool:
    """Return memory that was freed to the system; returns whether the C library can.

    The GNU C library raises both limits with each large array that is freed, up to 32 and 64 MB. Each thread has a
    heap of its own, so a process whose threads compute maps and draw reports would grow by up to 64 MB for each.
    """
    change = getattr(ctypes.CDLL(None), "mallopt", None)
    if change is None:
        return False
    return bool(change(_TRIM_THRESHOLD, _KEPT_BYTES) and change(_MMAP_THRESHOLD, _MAPPED_BYTES))
