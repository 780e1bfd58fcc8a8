# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Values of options that are moments or durations."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from typing import Any

import click

_UNITS_S = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86_400.0, "w": 604_800.0}


class Moment(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A time in ISO 8601 with or without a time zone, converted to UTC; without a zone it is UTC."""

    name = "time"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> datetime:
        """The time in UTC."""
        if isinstance(value, datetime):
            return value
        try:
            moment = datetime.fromisoformat(re.sub(r"\s*(UTC|GMT|Z)$", "+00:00", str(value).strip()))
            return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
        except (ValueError, OverflowError):
            self.fail(
                f"{value!r} is no time: write 2026-05-02T14:30Z, 2026-05-02T16:30+02:00 or 2026-05-02", param
            )


class Shift(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A duration with a sign and a unit, as seconds."""

    name = "duration"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The duration [s]."""
        if isinstance(value, float):
            return value
        found = re.fullmatch(r"([+-]?\d+(?:\.\d+)?)\s*(s|min|h|d|w)", str(value).strip())
        if found is None:
            self.fail(f"{value!r} is no duration: write it with s, min, h, d or w, such as -18s or 1024w", param)
        return float(found[1]) * _UNITS_S[found[2]]
