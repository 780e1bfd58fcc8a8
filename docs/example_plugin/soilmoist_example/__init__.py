# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Additions to soilmoist_ros."""

from pathlib import Path


def acme() -> Path:
    """The file of the logger format."""
    return Path(__file__).with_name("acme.yaml")
