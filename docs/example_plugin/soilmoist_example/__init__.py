"""Additions to soilmoist_ros."""

from pathlib import Path


def acme() -> Path:
    """The file of the logger format."""
    return Path(__file__).with_name("acme.yaml")
