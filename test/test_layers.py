"""The layer rule: what may import what. Imports are read from the source, also those inside functions."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CORE = ("sensing", "mapping", "exploration", "simulation", "recording", "reporting", "replay")
ROS = {"rclpy", "msg_adapters", "sensor_msgs", "std_msgs", "nav_msgs", "geometry_msgs", "diagnostic_msgs",
       "visualization_msgs", "std_srvs", "rosgraph_msgs", "builtin_interfaces", "ament_index_python", "launch",
       "launch_ros", "topological_navigation_msgs"}  # fmt: skip
ALLOWED = {
    "sensing": {"sensing"},
    "mapping": {"mapping", "sensing"},
    "exploration": {"exploration", "mapping", "sensing"},
    "simulation": {"simulation", "exploration", "mapping", "sensing"},
    "recording": {"recording", "mapping", "sensing"},
    "reporting": {"reporting", "simulation", "exploration", "mapping", "sensing"},
    "replay": {"replay", "recording", "reporting", "simulation", "mapping", "sensing"},
}


def imports(path: Path) -> set[str]:
    """Absolute names of all modules that a file imports."""
    package = path.relative_to(ROOT).with_suffix("").parts[:-1]
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            names.add(".".join(filter(None, [base, node.module])))
    return names


def core_files() -> list[Path]:
    return [path for name in CORE for path in sorted((ROOT / "soilmoist_ros" / name).glob("**/*.py"))]


@pytest.mark.parametrize("path", core_files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_the_core_never_imports_ros(path):
    assert not {name for name in imports(path) if name.split(".")[0] in ROS}


@pytest.mark.parametrize("path", core_files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_folders_import_only_what_comes_before_them(path):
    folder = path.relative_to(ROOT / "soilmoist_ros").parts[0]
    used = {name.split(".")[1] for name in imports(path) if name.startswith("soilmoist_ros.")}
    assert used & set(CORE) <= ALLOWED[folder]


def test_the_rule_sees_relative_and_nested_imports(tmp_path):
    path = ROOT / "soilmoist_ros" / "mapping" / "_example.py"
    tree = "def f():\n    from ..exploration import x\n    import rclpy.node\n"
    original = Path.read_text
    try:
        Path.read_text = lambda self, *a, **k: tree if self == path else original(self, *a, **k)
        assert imports(path) == {"soilmoist_ros.exploration", "rclpy.node"}
    finally:
        Path.read_text = original
