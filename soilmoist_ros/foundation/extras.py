"""Modules of optional extras, imported on use."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from soilmoist_ros.foundation.errors import InputError


def optional_module(name: str, extra: str) -> Any:
    """A module of an optional extra of this package.

    :param name: name of the module
    :param extra: name of the extra that installs it
    :raises InputError: if it is not installed; states how to install it

    >>> optional_module("absent", "frames")
    Traceback (most recent call last):
    ...
    soilmoist_ros.foundation.errors.InputError: absent is not installed -> pip install "soilmoist_ros[frames]"
    """
    try:
        return import_module(name)
    except ImportError:
        raise InputError(f"{name} is not installed", f'pip install "soilmoist_ros[{extra}]"') from None
