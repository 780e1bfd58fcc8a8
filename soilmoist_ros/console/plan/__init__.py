"""What the page *Plan* needs: outlines from files and from walks, field files, forecasts by simulation."""

from __future__ import annotations

__all__: list[str] = []
