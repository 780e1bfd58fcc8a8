# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Package metadata, for pip and for colcon (ament_python)."""

import re
from pathlib import Path

from setuptools import find_packages, setup

NAME = "soilmoist_ros"
NODES = ("sensor_driver", "mapper", "planner", "recorder", "field_simulator", "console", "watchdog")
BAGS = ["mcap>=1.2", "rosbags>=0.11", "lz4>=4.0", "zstandard>=0.20"]
TEST = ["pytest>=8", "pytest-xdist>=3.5", "hypothesis>=6.100", "mpmath>=1.3"]
ROOT = Path(__file__).resolve().parent  # colcon build --symlink-install runs a link to this file
VERSION_FILE = ROOT / NAME / "foundation" / "version.py"
VERSION = re.search(r'^__version__ = "(.+)"$', VERSION_FILE.read_text(encoding="utf-8"), re.M)


def shared(folder: str) -> list[tuple[str, list[str]]]:
    """Files below a folder, to be installed at the same place below share/soilmoist_ros."""
    files = [path for path in (ROOT / folder).rglob("*") if path.is_file() and path.parent.name != "__pycache__"]
    folders = sorted({path.parent for path in files})
    return [
        (
            f"share/{NAME}/{here.relative_to(ROOT).as_posix()}",
            [str(path.relative_to(ROOT)) for path in sorted(here.iterdir()) if path.is_file()],
        )
        for here in folders
    ]


setup(
    name=NAME,
    version=VERSION[1],
    description="Soil-moisture mapping with a cosmic-ray neutron sensor on a robot",
    long_description=(ROOT / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    author="The soilmoist_ros developers",
    maintainer="The soilmoist_ros developers",
    maintainer_email="maintainers@soilmoist-ros.example.org",
    python_requires=">=3.11",
    packages=find_packages(include=[NAME, f"{NAME}.*", "msg_adapters", "msg_adapters.*"]),
    package_data={
        NAME: ["py.typed", "reporting/page/templates/*", "sensing/corrections/*.csv", "console/page/*"],
        "msg_adapters": ["py.typed"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        *shared("config"),
        *shared("launch"),
        *shared("examples"),
    ],
    # The core is light: reading logs, mapping, planning, simulating. What writes pictures or rasters is an extra.
    install_requires=[
        "numpy>=1.26",
        "scipy>=1.11",
        "shapely>=2.0",
        "pydantic>=2.7",
        "ruamel.yaml>=0.17.21",
        "pykrige>=1.7",
        "pynmea2>=1.19",
        "click>=8.1",
        "rich>=13.7",
        "pyserial>=3.5",
    ],
    # soilmoist_ros/foundation/registry.py names the extra of each module in messages.
    extras_require={
        # Reports, GeoTIFFs, reference systems and GIS exports.
        "reports": [
            "matplotlib>=3.6",
            "jinja2>=3.1",
            "rasterio>=1.3",
            "pyproj>=3.6",
            "pyogrio>=0.8",
            "shapely>=2.1",
        ],
        # Recordings: the recorder, soilmoist bag, map and replay of bags.
        "bags": [*BAGS],
        # Real ROS 2 Jazzy for laptops and CI (x86_64 only) with recordings; a robot has ROS from apt.
        "ros": [*BAGS, "ros-jazzy-rclpy[fastrtps]==7.1.6", "ros-jazzy-common-interfaces==5.3.6"],
        # Campaigns with tables and reports; the routes of adaptive_sampling and lattice,
        # by PyVRP, whose data classes change between versions.
        "campaign": ["pandas>=2.2", "jinja2>=3.1", "pyvrp>=0.14,<0.15"],
        # The operator's page.
        "console": ["aiohttp>=3.9", "segno>=1.5"],
        # `colcon test` starts pytest for packages with an extra of this name.
        "test": [*TEST],
        # Tests, checks, packaging, and what the benchmarks compare with.
        "dev": [
            *TEST,
            "axe-playwright-python>=0.1",
            "build>=1.2",
            "colcon-core",
            "colcon-library-path",
            "colcon-python-setup-py",
            "colcon-ros",
            "crnpy>=0.7",
            "gstools>=1.5",
            "mcap-ros2-support>=0.5",
            "import-linter>=2.17",
            "mypy>=1.10",
            "playwright>=1.40",  # the operator's page in a real browser
            "pylibkriging>=0.8",
            "ruff>=0.6",
            "scikit-learn>=1.4",
            "threadpoolctl>=3.4",
            "twine>=6",
            "wheel",  # builds the example plug-in
        ],
    },
    entry_points={
        "console_scripts": [
            "soilmoist = soilmoist_ros.cli.main:main",
            *(f"{node} = soilmoist_ros.nodes.{node}:main" for node in NODES),
        ]
    },
    zip_safe=False,
)
