"""Names of a package that are imported when they are first used."""

import sys

import pytest

INIT = """from typing import TYPE_CHECKING
from soilmoist_ros.foundation.lazy import load_on_use
if TYPE_CHECKING:
    from {name}.heavy import answer
__all__ = ["answer"]
__getattr__ = load_on_use(__name__, __file__)
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


def test_other_names_do_not_exist(package):
    with pytest.raises(AttributeError, match="'a_lazy_package' has no attribute 'question'"):
        _ = __import__(package).question
    with pytest.raises(ImportError, match="question"):
        exec(f"from {package} import question")
