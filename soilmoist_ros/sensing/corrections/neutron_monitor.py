"""Incoming cosmic-ray intensity from the CSV file of a neutron monitor."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation.errors import InputError, Mistake

_MAX_GAP_S = 6 * 3600.0


@dataclass(frozen=True)
class NeutronMonitor:
    """A time series of incoming intensity.

    :param stamp_s: times [s since 1970-01-01 UTC], shape (n,), ascending
    :param rate: neutron-monitor rate, any unit, shape (n,), > 0
    """

    stamp_s: NDArray[np.float64]
    rate: NDArray[np.float64]

    def at(self, stamp_s: float) -> float | None:
        """Rate at a time, linear between neighbours; ``None`` outside the series or in a gap over 6 h."""
        after = int(np.searchsorted(self.stamp_s, stamp_s))
        if after < len(self.stamp_s) and self.stamp_s[after] == stamp_s:
            return float(self.rate[after])
        if after == 0 or after == len(self.stamp_s):
            return None
        if self.stamp_s[after] - self.stamp_s[after - 1] > _MAX_GAP_S:
            return None
        return float(np.interp(stamp_s, self.stamp_s, self.rate))


def read_neutron_monitor(path: Path) -> NeutronMonitor:
    """Read a CSV of time (ISO 8601, UTC) and rate, as exported by the neutron monitor database NMDB.

    The separator is ``;`` or ``,``. Lines starting with ``#`` and lines without a time are headers. Rows with an
    empty or null rate are skipped.

    :raises InputError: if the file cannot be read, or no row has a time and a positive rate
    """
    try:
        text = path.read_bytes().decode("utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", "check 'file' under 'intensity'", path) from None
    rows: dict[float, float] = {}
    faults: list[Mistake] = []
    for number, line in enumerate(text.splitlines(), start=1):
        cells = [cell.strip() for cell in re.split(r"[;,]", line)]
        stamp_s = _stamp(cells[0]) if len(cells) >= 2 else None
        if stamp_s is None or cells[1].lower() in ("", "null", "nan"):
            continue
        try:
            rate = float(cells[1])
        except ValueError:
            rate = float("nan")
        if not (np.isfinite(rate) and rate > 0):
            faults.append(Mistake(f"rate {cells[1]!r} is not a positive number", "correct the row", path, number))
            continue
        rows[stamp_s] = rate
    if faults:
        raise InputError(faults)
    if not rows:
        raise InputError(
            "has no row of time and rate",
            "expected lines such as '2018-05-01 14:00:00;151.2' (UTC), as exported from nmdb.eu",
            path,
        )
    stamps = np.array(sorted(rows))
    return NeutronMonitor(stamps, np.array([rows[stamp] for stamp in stamps]))


def _stamp(text: str) -> float | None:
    try:
        time = datetime.fromisoformat(text.replace("Z", "+00:00").replace("/", "-"))
    except ValueError:
        return None
    return (time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()
