# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Things chosen by name: found, added by installed packages, refused with a reason."""

from __future__ import annotations

import logging
import re
import sys
import threading
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
import setuptools  # noqa: F401 - before distutils, which Python 3.12 no longer has

from soilmoist_ros.foundation import Batches
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.registry import EXTRAS, Registry, is_installed, optional_module

GROUP = "soilmoist_ros.test_shapes"
CORNERS = {"circle": 0, "square": 4}
Install = Callable[..., None]


def corners(plug_in: Any) -> int:
    if not isinstance(plug_in, int):
        raise TypeError(f"a shape is a number of corners, not {plug_in!r}")
    return plug_in


@pytest.fixture
def shapes() -> Registry[int]:
    return Registry(GROUP, "shape", CORNERS, corners)


@pytest.fixture
def install(install_plug_ins: Install) -> Install:
    return partial(install_plug_ins, GROUP)


def test_built_in_names_are_found_without_a_look_at_installed_packages(
    shapes: Registry[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.metadata.entry_points", lambda **_: pytest.fail("entry points were read"))
    assert shapes.get("square") == 4


def test_an_installed_package_adds_a_name(shapes: Registry[int], install: Install) -> None:
    install("more_shapes", "TRIANGLE = 3\n", triangle="TRIANGLE")
    assert shapes.names() == ["circle", "square", "triangle"]
    assert shapes.get("triangle") == 3


def test_an_unknown_name_is_refused_with_the_names_there_are(shapes: Registry[int], install: Install) -> None:
    install("more_shapes", "TRIANGLE = 3\n", triangle="TRIANGLE")
    with pytest.raises(InputError, match=r"no shape 'triangel' -> use one of: circle, square, triangle \(did you"):
        shapes.get("triangel")
    with pytest.raises(InputError, match="no shape is given -> use one of"):
        shapes.get("")


@pytest.mark.parametrize(
    ("package", "code", "reason"),
    [
        ("import_fails", "import no_such_module_at_all\n", "ModuleNotFoundError"),
        ("object_is_missing", "", "AttributeError"),
        ("object_is_refused", "X = 'x'\n", "not 'x'"),
    ],
)
def test_a_broken_plug_in_is_skipped_with_one_warning(
    shapes: Registry[int], install: Install, caplog: pytest.LogCaptureFixture, package: str, code: str, reason: str
) -> None:
    install(package, code, spiral="X")
    with caplog.at_level(logging.WARNING):
        assert shapes.names() == shapes.names() == ["circle", "square"]
    (record,) = caplog.records
    assert all(word in record.getMessage() for word in ("'spiral'", package, reason))
    with pytest.raises(InputError, match=f"cannot be loaded: .*{reason}.* -> repair or uninstall {package}"):
        shapes.get("spiral")


def test_two_packages_that_add_one_name_are_both_named(
    shapes: Registry[int], install: Install, caplog: pytest.LogCaptureFixture
) -> None:
    install("first_shapes", "STAR = 5\n", star="STAR")
    install("second_shapes", "STAR = 6\n", star="STAR")
    with pytest.raises(InputError, match=r"first_shapes.*second_shapes|second_shapes.*first_shapes"):
        shapes.get("star")
    assert "star" not in shapes.names()
    assert "first_shapes" in caplog.text
    assert "second_shapes" in caplog.text


def test_a_name_is_added_at_run_time_once(shapes: Registry[int], install: Install) -> None:
    shapes.add("hexagon", 6)
    assert shapes.get("hexagon") == 6
    with pytest.raises(InputError, match="a shape 'hexagon' already"):
        shapes.add("hexagon", 7)
    install("more_shapes", "TRIANGLE = 3\n", triangle="TRIANGLE")
    shapes.refresh()
    with pytest.raises(InputError, match=r"more_shapes \(more_shapes:TRIANGLE\) adds a shape 'triangle' already"):
        shapes.add("triangle", 4)


# Extras ----------------------------------------------------------------------------------------------------------

ROOT = Path(__file__).resolve().parents[2]
COMES_WITH = {"markupsafe": "jinja2"}


def test_extras_are_those_of_the_package():
    from distutils.core import run_setup

    extras = run_setup(str(ROOT / "setup.py"), stop_after="init").extras_require
    for module, extra in EXTRAS.items():
        names = {re.split(r"[<>=\[]", line)[0].replace("-", "_") for line in extras[extra]}
        assert COMES_WITH.get(module, module) in names


def test_an_absent_module_of_an_extra_is_an_error_with_a_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "rasterio", None)
    assert not is_installed("numpy", "rasterio")
    with pytest.raises(InputError, match=r"rasterio is not installed -> pip install 'soilmoist_ros\[reports\]'"):
        optional_module("rasterio")


def test_a_module_of_no_extra_is_a_fault_of_the_installation():
    assert find_spec("soilmoist_absent") is None
    with pytest.raises(ModuleNotFoundError, match="soilmoist_absent"):
        optional_module("soilmoist_absent")


# A thread that handles what arrives in batches (workers.py) ------------------------------------------------------


LIMIT_S = 30.0


def test_items_that_wait_are_one_batch_in_the_order_of_arrival():
    begun, go_on, batches = threading.Event(), threading.Event(), []

    def handle(batch):
        batches.append(list(batch))
        begun.set()
        go_on.wait(LIMIT_S)

    thread = Batches(handle, "test", max_items=3)
    thread.put(1)
    assert begun.wait(LIMIT_S)
    for item in range(2, 7):
        thread.put(item)
    go_on.set()
    thread.close()
    assert batches == [[1], [2, 3, 4]]
    assert thread.lost == 2
    thread.close()


def test_a_batch_that_fails_does_not_end_the_thread():
    handled = []

    def handle(batch):
        if batch == ["bad"]:
            failed.set()
            raise RuntimeError("bad item")
        handled.extend(batch)
        done.set()

    failed, done = threading.Event(), threading.Event()
    thread = Batches(handle, "test")
    thread.put("bad")
    assert failed.wait(LIMIT_S)
    thread.put("good")
    assert done.wait(LIMIT_S)
    thread.close()
    assert handled == ["good"]


def test_a_flush_waits_until_everything_is_handled():
    begun, go_on, handled = threading.Event(), threading.Event(), []

    def handle(batch):
        begun.set()
        go_on.wait(LIMIT_S)
        handled.extend(batch)

    thread = Batches(handle, "test")
    assert thread.flush(0.0)
    thread.put(1)
    assert begun.wait(LIMIT_S)
    thread.put(2)
    assert not thread.flush(0.01)
    go_on.set()
    assert thread.flush(LIMIT_S)
    assert handled == [1, 2]
    thread.close()
