# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Who has the controls (controls.py)."""

from __future__ import annotations

from soilmoist_ros.console.controls import ABSENT_S, Controls


def test_one_page_has_the_controls_and_another_may_take_over():
    controls = Controls(lambda: 0.0)
    assert controls.who == ""
    assert controls.take("a", "Ada")
    assert not controls.take("b", "Bo")
    assert (controls.who, controls.holds("a"), controls.holds("b")) == ("Ada", True, False)
    assert controls.take("b", "Bo", over=True)
    assert (controls.who, controls.holds("a"), controls.holds("b")) == ("Bo", False, True)
    assert not controls.take("", "nobody", over=True)


def test_the_controls_of_a_page_that_is_gone_are_free_after_a_while():
    now = [0.0]
    controls = Controls(lambda: now[0])
    controls.connect("a")
    controls.take("a", "Ada")
    now[0] = 1000.0
    assert not controls.take("b", "Bo")
    controls.disconnect("a")
    now[0] += ABSENT_S - 1
    assert not controls.take("b", "Bo"), "it may be reloading"
    now[0] += 2
    assert controls.who == ""
    assert controls.take("b", "Bo")
