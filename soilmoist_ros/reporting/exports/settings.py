"""Settings of exports."""

from __future__ import annotations

from dataclasses import dataclass

ROOT_DEPTH_MM = 300.0


@dataclass(frozen=True)
class ExportSettings:
    """Settings of exports.

    :param zones: number of classes of management zones, where the run has no limits of its own
    :param min_zone_ha: area from which a part of the field is a zone of its own [ha]; by default 5 % of the field
    :param step: distance of contour lines in the unit for readers; by default a round one
    :param root_depth_mm: depth of the root zone for its water [mm]; by default that of the run, else 300
    """

    zones: int = 3
    min_zone_ha: float | None = None
    step: float | None = None
    root_depth_mm: float | None = None
