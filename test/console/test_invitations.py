# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""How a phone gets to the page (invitation.py)."""

from __future__ import annotations

import ipaddress
import sys

from soilmoist_ros.console.invitations import invitation, reachable


def test_everywhere_is_an_address_to_open():
    found = reachable("0.0.0.0")
    assert found not in ("", "0.0.0.0")
    if found[0].isdigit():
        ipaddress.ip_address(found)


def test_the_address_comes_with_a_code_for_phones(monkeypatch):
    text, *code = invitation("http://192.168.1.5:8050/", "abc").splitlines()
    assert "http://192.168.1.5:8050/?token=abc" in text
    assert len([line for line in code if line.strip()]) > 10
    monkeypatch.setitem(sys.modules, "segno", None)
    assert invitation("http://192.168.1.5:8050", "abc").splitlines() == [text]
