# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Names of a package that are imported when they are first used."""

import re
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
import setuptools  # noqa: F401 - before distutils, which Python 3.12 no longer has

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.lazy import EXTRAS, is_installed, optional_module

ROOT = Path(__file__).resolve().parents[2]
COMES_WITH = {"markupsafe": "jinja2"}

INIT = """from typing import TYPE_CHECKING
from soilmoist_ros.foundation.lazy import open_door
if TYPE_CHECKING:
    from {name}.heavy import answer as answer
__getattr__, __dir__, __all__ = open_door(__name__, {{"heavy": "answer"}})
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    name = "a_lazy_package"
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text(INIT.format(name=name))
    (tmp_path / name / "heavy.py").write_text("answer = 42\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield name
    for module in [module for module in sys.modules if module.startswith(name)]:
        del sys.modules[module]


def test_a_name_is_imported_when_it_is_used(package):
    module = __import__(package)
    assert f"{package}.heavy" not in sys.modules
    assert module.answer == 42
    assert f"{package}.heavy" in sys.modules
    assert dir(module) == module.__all__ == ["answer"]


def test_other_names_do_not_exist(package):
    with pytest.raises(AttributeError, match="'a_lazy_package' has no attribute 'other'"):
        _ = __import__(package).other
    with pytest.raises(ImportError, match="other"):
        exec(f"from {package} import other")


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
