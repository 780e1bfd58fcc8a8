# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Things chosen by name: found, added by installed packages, refused with a reason."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.registry import Registry

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
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Puts a package with entry points where Python finds it."""

    def write(package: str, code: str, **points: str) -> None:
        folder = tmp_path / package
        metadata = folder / f"{package}-1.0.dist-info"
        metadata.mkdir(parents=True)
        (folder / f"{package}.py").write_text(code)
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        lines = [f"[{GROUP}]", *(f"{name} = {package}:{value}" for name, value in points.items())]
        (metadata / "entry_points.txt").write_text("\n".join(lines) + "\n")
        monkeypatch.syspath_prepend(str(folder))

    return write


def test_built_in_names_are_found_without_a_look_at_installed_packages(
    shapes: Registry[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.metadata.entry_points", lambda **_: pytest.fail("entry points were read"))
    assert shapes.get("square") == 4


def test_an_installed_package_adds_a_name(shapes: Registry[int], install: Install) -> None:
    install("more_shapes", "TRIANGLE = 3\n", triangle="TRIANGLE")
    assert shapes.names() == ["circle", "square", "triangle"]
    assert shapes.get("triangle") == 3


def test_built_in_objects_may_be_made_at_the_first_use() -> None:
    calls = []
    shapes = Registry(GROUP, "shape", lambda: calls.append("made") or CORNERS)
    assert not calls
    assert (shapes.get("circle"), shapes.get("square")) == (0, 4)
    assert calls == ["made"]


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


def test_a_package_does_not_replace_a_built_in_name(
    shapes: Registry[int], install: Install, caplog: pytest.LogCaptureFixture
) -> None:
    install("rude_shapes", "SQUARE = 5\n", square="SQUARE")
    assert shapes.names() == ["circle", "square"]
    assert "'square'" in caplog.text
    assert "rude_shapes" in caplog.text
    assert shapes.get("square") == 4


def test_a_name_is_added_at_run_time_once(shapes: Registry[int], install: Install) -> None:
    shapes.add("hexagon", 6)
    assert shapes.get("hexagon") == 6
    with pytest.raises(InputError, match="a shape 'hexagon' already"):
        shapes.add("hexagon", 7)
    install("more_shapes", "TRIANGLE = 3\n", triangle="TRIANGLE")
    shapes.refresh()
    with pytest.raises(InputError, match=r"more_shapes \(more_shapes:TRIANGLE\) adds a shape 'triangle' already"):
        shapes.add("triangle", 4)


def test_a_package_installed_later_is_found_after_a_refresh(shapes: Registry[int], install: Install) -> None:
    assert "triangle" not in shapes.names()
    install("more_shapes", "TRIANGLE = 3\n", triangle="TRIANGLE")
    shapes.refresh()
    assert "triangle" in shapes.names()
