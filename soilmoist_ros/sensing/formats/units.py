"""Conversion from the units of loggers to the units of this package."""

from __future__ import annotations

from collections.abc import Callable

Converter = Callable[[float], float]

_PRESSURE = {"hPa": 1.0, "mb": 1.0, "mbar": 1.0, "Pa": 0.01, "kPa": 10.0}
_DURATION = {"s": 1.0, "ms": 0.001, "min": 60.0, "h": 3600.0}


def to_hpa(unit: str) -> Converter:
    """Converter of a pressure unit to hPa."""
    return _scale(_PRESSURE[unit])


def to_seconds(unit: str) -> Converter:
    """Converter of a unit of duration to seconds."""
    return _scale(_DURATION[unit])


def to_degc(unit: str) -> Converter:
    """Converter of a temperature unit to degC."""
    if unit == "K":
        return lambda value: value - 273.15
    if unit == "degF":
        return lambda value: (value - 32.0) / 1.8
    return _scale(1.0)


def to_fraction(unit: str) -> Converter:
    """Converter of a unit of relative humidity to 0..1."""
    return _scale(0.01 if unit == "percent" else 1.0)


def _scale(factor: float) -> Converter:
    if factor == 0.01:
        return lambda value: value / 100.0  # dividing keeps 965.0 hPa exactly 965.0
    return lambda value: value * factor
