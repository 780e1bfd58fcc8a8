"""The package as pip, colcon and ROS see it."""

import re
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import click
import numpy as np
import pytest

import soilmoist_ros
from soilmoist_ros.cli.main import main
from soilmoist_ros.exploration.planning.dwell import parse_dwell
from soilmoist_ros.exploration.strategies.registry import STRATEGIES
from soilmoist_ros.foundation.configuration import config_folder, resource_names
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.simulation.campaign.campaign_file import load_campaign, missions
from soilmoist_ros.simulation.fields.catalogue import surrogate_field, surrogate_field_names

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def readme_blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


def readme_table(first_heading):
    """The `names` in the first column of a table, which is found by the heading of that column."""
    table = re.search(rf"^ *\| {re.escape(first_heading)} \|.*\n *\|[-|]+\n((?: *\|.*\n)+)", README, re.MULTILINE)
    return [name for row in table[1].splitlines() for name in re.findall("`([^`]+)`", row.split("|")[1])]


def readme_commands():
    """Every `soilmoist` command of the README, as arguments."""
    shell = "".join(readme_blocks("sh")).replace("\\\n", " ").splitlines()
    inline = re.findall(r"`((?:\.venv/bin/)?soilmoist [^`]+)`", README.replace("\n", " "))
    found = [shlex.split(line, comments=True) for line in [*shell, *inline]]
    return [words[1:] for words in found if words and words[0].removeprefix(".venv/bin/") == "soilmoist"]


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
    assert all(f'*shared("{folder}")' in text for folder in ("config", "launch", "examples"))
    assert config_folder() == ROOT / "config"


def test_no_tracked_file_names_a_path_outside_the_clone():
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    outside = []
    for name in listed.split("\0"):
        path = ROOT / name
        content = path.read_bytes() if path.is_file() else b""
        if b"\0" in content:  # a picture or a bag
            continue
        text = content.decode()
        upwards = [up for up in re.findall(r"(?:\.\./)+[\w./-]*", text)
                   if not (path.parent / up).resolve().is_relative_to(ROOT)]  # fmt: skip
        absolute = re.findall(r"(?<![\w.:/])/(?:home|Users|root|work|mnt)/[\w./-]+", text)
        outside += [(name, found) for found in (*upwards, *absolute, *re.findall(r"\bROOT\.parent\b", text))]
    assert outside == []


@pytest.mark.process
@pytest.mark.parametrize(
    ("module", "more"),
    [
        ("cli.main", {"numpy", "pydantic", "ruamel.yaml"}),
        ("mapping", {"pydantic", "ruamel.yaml"}),
        # what the nodes start with
        ("sensing.survey.driver", {"mcap", "rosbags"}),
        ("replay.online_survey", {"mcap", "rosbags", "soilmoist_ros.reporting"}),
        ("exploration.control.mission_control", {"mcap", "rosbags"}),
        ("recording.journal", {"numpy", "pydantic", "mcap", "rosbags"}),
        ("recording.bag.recorder", {"numpy", "rosbags"}),
        ("simulation.system", {"mcap", "rosbags", "soilmoist_ros.reporting"}),
    ],
)
def test_the_core_is_light_to_import(module, more):
    heavy = {"matplotlib", "rasterio", "pyproj", "shapely", "scipy", "pykrige", "pandas", "jinja2", "rclpy", *more}
    code = f"import sys, soilmoist_ros.{module}; print(*({heavy!r} & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []


@pytest.mark.parametrize("arguments", readme_commands(), ids=" ".join)
def test_the_command_takes_what_the_readme_gives_it(arguments):
    name, *rest = arguments
    command = main.commands[name]
    if not rest or rest == ["--help"]:  # the command is only named
        return
    context = command.make_context(name, rest)
    assert isinstance(context, click.Context)


def test_the_readme_shows_every_command():
    shown = {arguments[0] for arguments in readme_commands() if "--help" not in arguments}
    assert shown == set(main.commands)


def test_the_tables_of_the_readme_are_complete():
    with_truth = []
    for name in resource_names("fields"):
        try:
            surrogate_field(name)
        except InputError:
            continue
        with_truth.append(name)
    assert sorted(readme_table("`--field`")) == sorted([*surrogate_field_names(), *with_truth])
    assert tuple(readme_table("`--strategy`")) == STRATEGIES
    assert [str(parse_dwell(text)) for text in readme_table("`--dwell`")] == readme_table("`--dwell`")
    assert sorted(readme_table("name")) == resource_names("loggers")
    folders = {path.name for path in (ROOT / "soilmoist_ros").iterdir() if (path / "__init__.py").is_file()}
    named = {Path(name).name for name in readme_table("folder") if name.startswith("soilmoist_ros/")}
    assert named <= folders
    assert {"sensing", "mapping", "exploration", "simulation", "reporting"} <= named


def test_the_paths_and_links_of_the_readme_lead_somewhere():
    paths = re.findall(r"`((?:config|scripts|soilmoist_ros|msg_adapters|launch)/[\w./-]*)`", README)
    assert paths
    assert [path for path in paths if not (ROOT / path).exists()] == []
    anchors = {re.sub(r"[^\w -]", "", title).strip().lower().replace(" ", "-")
               for title in re.findall(r"^#+ (.*)$", README, re.MULTILINE)}  # fmt: skip
    links = re.findall(r"\]\(#([\w-]+)\)", README)
    assert links
    assert set(links) <= anchors


def test_the_campaign_of_the_readme_can_be_run(tmp_path):
    block, team = readme_blocks("yaml")
    assert "others: [/robot_1, /robot_2]" in team
    (tmp_path / "campaign.yaml").write_text(block)
    planned = missions(load_campaign(str(tmp_path / "campaign.yaml")))
    assert len(planned) == 5 * 2 * 3 * 2
    count = re.search(r"(\d+) missions", README)[1]
    assert int(count) == len(missions(load_campaign("paper")))


def test_the_python_of_the_readme_runs(capsys):
    rng = np.random.default_rng(1)
    xy = rng.uniform(0, 50, (30, 2))
    names = {"xy": xy, "xy_new": xy[:3] + 1, "counts": rng.poisson(1000, 30), "exposure_s": np.full(30, 300.0)}
    for block in readme_blocks("python"):
        exec(block, names)
    assert names["rate"].shape == names["variance"].shape == (3,)
    assert (
        capsys.readouterr().out
        == f"{names['mission'].series[-1].vwc_rmse} {[v.name for v in names['mission'].visits]}\n"
    )
