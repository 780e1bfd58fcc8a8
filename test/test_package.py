"""The package as pip, colcon and ROS see it."""

import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import soilmoist_ros
from soilmoist_ros.configuration import config_folder

ROOT = Path(__file__).resolve().parent.parent


def test_package_xml_says_what_setup_py_says():
    root = ET.parse(ROOT / "package.xml").getroot()
    metadata = subprocess.run(
        [sys.executable, "setup.py", "--quiet", "--name", "--version", "--license", "--maintainer-email"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    maintainer = root.find("maintainer")
    assert metadata == [
        root.findtext("name"), root.findtext("version"), root.findtext("license"), maintainer.get("email")
    ]  # fmt: skip
    assert soilmoist_ros.__version__ == root.findtext("version")
    # colcon silently takes a package with a bad address for one that is not of ROS
    assert "@" in maintainer.get("email")
    assert "." in maintainer.get("email").split("@")[1]
    assert root.find("export").findtext("build_type") == "ament_python"


def test_the_ament_index_has_the_marker_of_the_package():
    assert (ROOT / "resource" / "soilmoist_ros").is_file()


def test_every_file_of_the_configuration_is_installed():
    text = (ROOT / "setup.py").read_text()
    assert '*shared("config")' in text
    assert config_folder() == ROOT / "config"


def test_the_core_is_light_to_import():
    heavy = {"matplotlib", "rasterio", "pyproj", "shapely", "scipy.optimize", "scipy.stats", "pydantic", "pandas"}
    code = f"import sys, soilmoist_ros.mapping; print(*({heavy!r} & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []


def test_colcon_builds_what_ros2_run_looks_for(tmp_path):
    source = tmp_path / "src" / "soilmoist_ros"
    tracked = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    for name in filter(None, tracked.split("\0")):
        if not name.startswith("test/") and (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, source / name)
    build = subprocess.run(
        [sys.executable, "-m", "colcon", "--log-base", "log", "build"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert build.returncode == 0, build.stdout + build.stderr
    prefix = tmp_path / "install" / "soilmoist_ros"
    assert (prefix / "lib" / "soilmoist_ros" / "soilmoist").stat().st_mode & 0o111
    assert (prefix / "share" / "ament_index" / "resource_index" / "packages" / "soilmoist_ros").is_file()
    assert (prefix / "share" / "soilmoist_ros" / "package.xml").is_file()
    site_packages = next((prefix / "lib").glob("python3*/site-packages"))
    checked = subprocess.run(
        [prefix / "lib" / "soilmoist_ros" / "soilmoist", "check", "--logger", "finapp", "--site", "example"],
        env={**os.environ, "PYTHONPATH": str(site_packages)}, cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert checked.stdout.splitlines() == ["ok: finapp", "ok: example"], checked.stderr
