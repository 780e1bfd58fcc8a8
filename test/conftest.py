# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Fixtures shared by all folders of tests."""

import os
import signal
import sys
import zlib
from functools import partial
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import settings

try:
    from hypothesis.internal.conjecture import providers
except ImportError:  # as in Ubuntu 24.04, whose Hypothesis draws nothing from modules
    providers = None

# Every run uses the same examples at any machine speed; HYPOTHESIS_PROFILE=search looks for new examples.
settings.register_profile("repeatable", derandomize=True, deadline=None)
# The quick tests take the first of them.
settings.register_profile("quick", derandomize=True, deadline=None, max_examples=10)
settings.register_profile("search", deadline=None)
PROFILE = os.environ.get("HYPOTHESIS_PROFILE", "repeatable")
settings.load_profile(PROFILE)
if PROFILE != "search" and hasattr(providers, "_local_constants"):
    # Some values are drawn from the numbers and texts of those modules of the project that happen to be loaded,
    # which depends on the tests that a worker ran before; there is no setting for it.
    providers._get_local_constants = lambda: providers._local_constants

# Set by scripts/test where all requirements are installed: a missing module is an error then, no reason to skip.
if os.environ.get("MODULES_REQUIRED"):
    pytest.importorskip = partial(pytest.importorskip, exc_type=())

# Shells start background jobs deaf to Ctrl-C, and programs that tests start would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def load_script():
    def load(name: str) -> ModuleType:
        path = ROOT / "scripts" / name
        loader = SourceFileLoader(path.stem, str(path))
        module = module_from_spec(spec_from_loader(path.stem, loader))
        with pytest.MonkeyPatch.context() as patch:
            patch.syspath_prepend(str(path.parent))
            patch.setattr(sys, "dont_write_bytecode", True)  # not next to the scripts
            patch.setitem(sys.modules, path.stem, module)  # where dataclasses look for it
            loader.exec_module(module)
        return module

    return load


@pytest.fixture(scope="session")
def roving_record() -> Path:
    """A real log with positions: one-minute records of a Hydroinnova probe on a car."""
    return ROOT / "examples" / "rover_gypsum_transect_2018-05-01.KSU"


@pytest.fixture(scope="session")
def reference_data() -> Path:
    """Folder of results that other programs computed."""
    return ROOT / "test" / "data"


def pytest_collection_modifyitems(items):
    """The nodes run as processes, so ``scripts/test --fast`` skips the whole folder.

    Files are in an order without a pattern: tests that wait for processes and tests that compute run together.
    """
    items.sort(key=lambda item: zlib.crc32(str(item.path.relative_to(ROOT)).encode()))
    for item in items:
        if ROOT / "test" / "nodes" in item.path.parents:
            item.add_marker(pytest.mark.process)


@pytest.fixture
def install_plug_ins(tmp_path, monkeypatch):
    """Puts a package with entry points of a group where Python finds it."""

    def install(group: str, package: str, code: str, **points: str) -> None:
        folder = tmp_path / package
        metadata = folder / f"{package}-1.0.dist-info"
        metadata.mkdir(parents=True)
        (folder / f"{package}.py").write_text(code)
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        lines = [f"[{group}]", *(f"{name} = {package}:{value}" for name, value in points.items())]
        (metadata / "entry_points.txt").write_text("\n".join(lines) + "\n")
        monkeypatch.syspath_prepend(str(folder))
        monkeypatch.delitem(sys.modules, package, raising=False)

    return install
