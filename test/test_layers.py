# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rules for imports, checked in the source of every file, including functions and type checks."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FLOORS = (
    "foundation",
    "sensing",
    "mapping",
    "exploration",
    "simulation",
    "recording",
    "pipeline",
    "reporting",
    "replay",
    "console",
    "lab",
    "nodes",
    "cli",
)
"""The folders of the package in the order of the data: each imports itself and those before it."""
ROS = {
    "action_msgs",
    "ament_index_python",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "launch",
    "launch_ros",
    "lifecycle_msgs",
    "nav_msgs",
    "rcl_interfaces",
    "rclpy",
    "rosgraph_msgs",
    "rosidl_runtime_py",
    "sensor_msgs",
    "soilmoist_msgs",
    "std_msgs",
    "std_srvs",
    "tf2_msgs",
    "topological_navigation_msgs",
    "unique_identifier_msgs",
    "visualization_msgs",
}


def sources(root: Path = ROOT) -> dict[str, Path]:
    """Every module of the product by its dotted name."""
    paths = [path for name in ("soilmoist_ros", "msg_adapters") for path in sorted((root / name).rglob("*.py"))]
    names = (".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__") for path in paths)
    return dict(zip(names, paths, strict=True))


@cache
def imports(path: Path, root: Path = ROOT) -> set[str]:
    """Absolute names of a file's imports: modules, and names that may be modules."""
    package = path.relative_to(root).parts[:-1]
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(filter(None, [base, node.module]))
            names |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
    return names


def edges(root: Path = ROOT) -> Iterator[tuple[str, str]]:
    """Pairs (module, imported module) of the product; a package only if no module in the package is imported."""
    modules = sources(root)
    for name, path in modules.items():
        found = imports(path, root) & set(modules)
        yield from (
            (name, other) for other in found if not any(deeper.startswith(f"{other}.") for deeper in found)
        )


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Every set of nodes that lead to each other."""
    reached: dict[str, set[str]] = {}
    for start in graph:
        seen: set[str] = set()
        waiting = [start]
        while waiting:
            for other in graph.get(waiting.pop(), set()) - seen:
                seen.add(other)
                waiting.append(other)
        reached[start] = seen
    found = {frozenset(other for other in reached[name] if name in reached.get(other, ())) for name in graph}
    return [sorted(circle) for circle in found if circle]


def rooms(pairs: Iterator[tuple[str, str]], depth: int) -> dict[str, set[str]]:
    """The graph of folders: names cut to ``depth`` parts, without edges from a folder to itself."""
    graph: dict[str, set[str]] = {}
    for name, other in pairs:
        here, there = (".".join(each.split(".")[:depth]) for each in (name, other))
        graph.setdefault(here, set())
        if here != there and there != "soilmoist_ros":
            graph[here].add(there)
    return graph


def ros_below_the_nodes(root: Path = ROOT) -> list[str]:
    """Files of the core that import ROS, or modules that need ROS."""
    return [
        f"{name} imports {other}"
        for name, path in sources(root).items()
        if not name.startswith(("msg_adapters", "soilmoist_ros.nodes"))
        for other in imports(path, root)
        if other.split(".")[0] in {*ROS, "msg_adapters"}
    ]


def upward(root: Path = ROOT) -> list[str]:
    """Imports from a later folder."""
    pairs = [(name.split("."), other.split(".")) for name, other in edges(root)]
    return [
        f"{'.'.join(name)} imports {'.'.join(other)}"
        for name, other in pairs
        if name[0] == other[0] == "soilmoist_ros" and len(name) > 1 and len(other) > 1
        if FLOORS.index(other[1]) > FLOORS.index(name[1])
    ]


@pytest.mark.slow
def test_only_nodes_and_adapters_import_ros():
    assert ros_below_the_nodes() == []


@pytest.mark.slow
def test_imports_go_down_only():
    assert upward() == []
    assert [f"{a} imports {b}" for a, b in edges() if a.startswith("msg_adapters") and ".nodes" in b] == []


def test_no_circles_of_modules():
    graph: dict[str, set[str]] = {name: set() for name in sources()}
    for name, other in edges():
        graph[name].add(other)
    assert circles(graph) == []


def test_no_circles_of_folders():
    assert circles(rooms(edges(), 3)) == []


def test_no_loose_files():
    top = {path.name for path in (ROOT / "soilmoist_ros").glob("*.py")}
    assert top == {"__init__.py"}
    assert {path.name for path in (ROOT / "soilmoist_ros").iterdir() if path.is_dir()} - {"__pycache__"} == {
        *FLOORS
    }


def test_the_rules_see_what_breaks_them(tmp_path):
    files = {
        "soilmoist_ros/mapping/a.py": "def f():\n    from ..exploration import x\n    import rclpy.node\n",
        "soilmoist_ros/mapping/b.py": "if TYPE_CHECKING:\n    from soilmoist_ros.mapping.c import x\n",
        "soilmoist_ros/mapping/c.py": "from soilmoist_ros.mapping import b\n",
        "soilmoist_ros/exploration/x.py": "",
        "msg_adapters/__init__.py": "",
    }
    for folder in ("soilmoist_ros", "soilmoist_ros/mapping", "soilmoist_ros/exploration"):
        files[f"{folder}/__init__.py"] = ""
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert {line.split()[2] for line in ros_below_the_nodes(tmp_path)} == {"rclpy.node"}
    assert upward(tmp_path) == ["soilmoist_ros.mapping.a imports soilmoist_ros.exploration.x"]
    graph: dict[str, set[str]] = {name: set() for name in sources(tmp_path)}
    for name, other in edges(tmp_path):
        graph[name].add(other)
    assert circles(graph) == [["soilmoist_ros.mapping.b", "soilmoist_ros.mapping.c"]]
