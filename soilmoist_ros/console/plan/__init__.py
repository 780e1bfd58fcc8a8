# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the page *Plan* needs: outlines from files and from walks, field files, forecasts by simulation."""

from __future__ import annotations

__all__: list[str] = []
