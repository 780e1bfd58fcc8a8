# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The package for pip, colcon and ROS."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import click
import numpy as np
import pytest
from ruamel.yaml import YAML

import soilmoist_ros
from soilmoist_ros.cli.main import COMMANDS, main
from soilmoist_ros.exploration import STRATEGIES, parse_dwell
from soilmoist_ros.foundation.configuration import config_folder, resource_names
from soilmoist_ros.lab.campaign_file import load_campaign, missions
from soilmoist_ros.reporting.exports.registry import EXPORTS
from soilmoist_ros.simulation.fields.catalogue import surrogate_field_names

ROOT = Path(__file__).resolve().parent.parent
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "examples/README.md")
}
"""README and every page of the documentation, by path."""
PLUG_IN = "docs/example_plugin/README.md"
"""Page whose commands need the plug-in; test_example_plugin.py runs them."""


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```", PAGES[page], re.DOTALL | re.MULTILINE)


def table(page, first_heading):
    found = re.search(
        rf"^ *\| {re.escape(first_heading)} \|.*\n *\|[-|]+\n((?: *\|.*\n)+)", PAGES[page], re.MULTILINE
    )
    return [name for row in found[1].splitlines() for name in re.findall("`([^`]+)`", row.split("|")[1])]


def commands(page):
    shell = "".join(blocks(page, "sh")).replace("\\\n", " ").splitlines()
    prose = re.sub(r"^```.*?^```", "", PAGES[page], flags=re.DOTALL | re.MULTILINE)
    inline = re.findall(r"`((?:\.venv/bin/)?soilmoist [^`]+)`", prose.replace("\n", " "))
    found = [shlex.split(line, comments=True) for line in [*shell, *inline]]
    return [words[1:] for words in found if words and words[0].removeprefix(".venv/bin/") == "soilmoist"]


def anchors(page):
    """Targets of links after `#`: the headings, as viewers of Markdown convert them."""
    prose = re.sub(r"^```.*?^```", "", PAGES[page], flags=re.DOTALL | re.MULTILINE)
    titles = re.findall(r"^#+ (.*)$", prose, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title).strip().lower().replace(" ", "-") for title in titles}


@pytest.mark.slow
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
    changes = (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8")
    released = re.findall(r"^(\d+\.\d+\.\d+) \((\d{4}-\d{2}-\d{2})\)\n-{18,}$", changes, re.MULTILINE)
    assert released[0][0] == soilmoist_ros.__version__
    # For a bad address colcon silently treats the package as one without ROS.
    assert "@" in maintainer.get("email")
    assert "." in maintainer.get("email").split("@")[1]
    assert root.find("export").findtext("build_type") == "ament_python"


def test_a_release_has_one_version_and_a_dated_section_of_the_changelog(load_script, tmp_path):
    release = load_script("release")
    names = ("CHANGELOG.rst", "CITATION.cff", "package.xml", "soilmoist_ros/foundation/version.py")
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    version = soilmoist_ros.__version__
    log = tmp_path / names[0]
    sections = [f"{heading}\n------------------\n* {text}\n\n" for heading, text in (
        (f"{version} (2026-12-01)", "New"), ("0.1.0 (2026-01-01)", "Old"))]  # fmt: skip
    log.write_text("Title\n^^^^^\n\n" + "".join(sections))
    assert release.changes(log.read_text()) == (f"{version} (2026-12-01)", "* New\n")
    assert release.missing(tmp_path) == []
    log.write_text("Forthcoming\n-----------\n* New\n")
    citation = tmp_path / names[1]
    citation.write_text(citation.read_text().replace(version, "9.9.9"))
    citation_said, log_said = release.missing(tmp_path)
    assert citation_said == f"CITATION.cff has the version 9.9.9, not {version}"
    assert "'Forthcoming'" in log_said


def test_every_file_of_the_configuration_and_the_marker_of_the_package_are_installed():
    text = (ROOT / "setup.py").read_text()
    assert all(f'*shared("{folder}")' in text for folder in ("config", "launch", "examples"))
    assert config_folder() == ROOT / "config"
    assert (ROOT / "resource" / "soilmoist_ros").is_file()


@pytest.mark.slow
def test_no_tracked_file_names_a_path_outside_the_clone():
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    outside = []
    for name in listed.split("\0"):
        path = ROOT / name
        content = path.read_bytes() if path.is_file() else b""
        if b"\0" in content:  # a picture or a bag
            continue
        text = content.decode(errors="replace")  # inputs that broke a reader are no text
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
        ("sensing.survey.driver", {"mcap", "rosbags", "scipy.optimize", "scipy.stats"}),
        ("pipeline.field_survey", {"mcap", "rosbags", "soilmoist_ros.reporting"}),
        ("exploration.control.mission_control", {"mcap", "rosbags"}),
        ("recording.journal", {"numpy", "pydantic", "mcap", "rosbags"}),
        ("recording.bag.recorder", {"numpy", "rosbags"}),
        ("simulation.system", {"mcap", "rosbags", "soilmoist_ros.reporting"}),
    ],
)
def test_the_core_is_light_to_import(module, more):
    heavy = {"matplotlib", "rasterio", "pyproj", "shapely", "pykrige", "pandas", "jinja2", "rclpy", *more}
    if module != "sensing.survey.driver":  # the tests of counts need the tails of distributions: scipy.special
        heavy |= {"scipy"}
    code = f"import sys, soilmoist_ros.{module}; print(*({heavy!r} & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []


@pytest.mark.parametrize(
    ("page", "arguments"),
    [
        pytest.param(page, words, id=f"{page}: {' '.join(words)}")
        for page in PAGES
        if page != PLUG_IN
        for words in commands(page)
    ],
)
def test_the_command_line_takes_the_commands_of_the_pages(page, arguments):
    name, *rest = arguments
    if name == "--help":
        return
    command = main.get_command(click.Context(main), name)
    while isinstance(command, click.Group) and rest:
        command, rest = command.commands[rest[0]], rest[1:]
    if not rest or rest == ["--help"]:  # the command is only named
        return
    assert isinstance(command.make_context(name, rest), click.Context)


def test_the_commands_of_the_readme_are_there_in_their_order():
    lines = "".join(blocks("README.md", "sh")).replace("\\\n", " ").splitlines()
    assert lines[0].startswith("python3 -m venv .venv && "), "what follows needs it"
    for first in [shlex.split(line, comments=True)[0] for line in lines[1:]]:
        known = first in ("ros2", ".venv/bin/soilmoist")
        assert known or (first.startswith("scripts/") and os.access(ROOT / first, os.X_OK))
    (film,) = re.findall(r"!\[[^\]]+\]\((docs/images/[^)]+)\)", PAGES["README.md"])
    assert (ROOT / film).stat().st_size < 3e6


def test_every_command_stands_on_a_page():
    shown = {words[0] for page in PAGES for words in commands(page) if "--help" not in words}
    assert shown == set(COMMANDS)


def test_readme_index_and_navigation_lead_to_every_page():
    linked = set()
    for page in ("README.md", "docs/index.md"):
        here = (ROOT / page).parent
        links = re.findall(r"\]\(([\w./-]+\.md)", PAGES[page])
        linked |= {(here / link).resolve().relative_to(ROOT).as_posix() for link in links}
    assert set(PAGES) - {"README.md"} <= linked
    shown = set(re.findall(r": ([\w./]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE))
    pages = {page.removeprefix("docs/") for page in PAGES} - {"README.md"}
    assert pages - shown - {"api.md"} == set(), "nav in mkdocs.yml has every page"
    assert len(PAGES["README.md"].splitlines()) <= 100


def test_the_tables_of_the_pages_are_complete():
    research = "docs/research.md"
    assert sorted(table(research, "`--field`")) == sorted(surrogate_field_names())
    assert tuple(table(research, "`--strategy`")) == tuple(STRATEGIES.names())
    assert [str(parse_dwell(text)) for text in table(research, "`--dwell`")] == table(research, "`--dwell`")
    assert table("docs/gis.md", "format") == EXPORTS.names()
    assert sorted(table("docs/crns.md", "name")) == resource_names("loggers")
    folders = {path.name for path in (ROOT / "soilmoist_ros").iterdir() if (path / "__init__.py").is_file()}
    folders.remove("replay")  # an old name
    named = {Path(name).name for name in table("CONTRIBUTING.md", "folder") if name.startswith("soilmoist_ros/")}
    assert named == folders
    extras = re.search(r"extras_require=\{(.*?)\n    \},", (ROOT / "setup.py").read_text(), re.DOTALL)[1]
    assert set(table("docs/first_try.md", "extra")) == set(
        re.findall(r'^        "([\w-]+)": \[', extras, re.MULTILINE)
    )
    benchmarks = {f"scripts/{path.name}" for path in (ROOT / "scripts").glob("bench_*.py")}
    assert set(table("docs/benchmarks.md", "script")) == benchmarks


@pytest.mark.parametrize("page", PAGES)
def test_paths_and_links_of_a_page_lead_somewhere(page):
    folders = "config|scripts|soilmoist_ros|msg_adapters|interfaces|launch|test|docs|examples"
    paths = re.findall(rf"[` (]((?:{folders})/[\w./-]*)", PAGES[page])
    paths = [path.rstrip(".") for path in paths if not re.search("NAME|NODE", path)]
    here = (ROOT, (ROOT / page).parent)
    broken = [path for path in paths if not any((folder / path).exists() for folder in here)]
    for link in re.findall(r"\]\(([^)\s]+)\)", PAGES[page]):
        if link.startswith("https://"):
            continue
        path, _, anchor = link.partition("#")
        target = ((ROOT / page).parent / path).resolve() if path else ROOT / page
        name = target.relative_to(ROOT).as_posix()
        if not target.exists() or (anchor and anchor not in anchors(name)):
            broken.append(link)
    assert broken == []


@pytest.mark.slow
def test_the_campaign_of_its_page_can_be_run(tmp_path):
    (block,) = blocks("docs/campaigns.md", "yaml")
    (tmp_path / "campaign.yaml").write_text(block)
    planned = missions(load_campaign(str(tmp_path / "campaign.yaml")))
    assert len(planned) == 5 * 2 * 3 * 2
    count = re.search(r"(\d+) missions", PAGES["docs/campaigns.md"])[1]
    assert int(count) == len(missions(load_campaign("paper")))


def test_the_team_of_its_page_is_what_the_nodes_read():
    (block,) = blocks("docs/teams.md", "yaml")
    content = YAML(typ="safe").load(block)
    assert set(content) == {"/**/mapper", "/**/planner"}
    assert all(node["ros__parameters"] == {"others": ["/robot_1", "/robot_2"]} for node in content.values())


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")])
def test_the_python_of_a_page_runs(page, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    rng = np.random.default_rng(1)
    xy = rng.uniform(0, 50, (30, 2))
    names = {"xy": xy, "xy_new": xy[:3] + 1, "counts": rng.poisson(1000, 30), "exposure_s": np.full(30, 300.0)}
    for block in blocks(page, "python"):
        exec(block, names)
    if "rate" in names:
        assert names["rate"].shape == names["variance"].shape == (3,)
    if "mission" in names:
        assert capsys.readouterr().out.startswith(f"{names['mission'].series[-1].vwc_rmse} [")


def test_the_messages_of_the_page_on_troubleshooting_exist():
    sources = [*ROOT.glob("soilmoist_ros/**/*.py"), *ROOT.glob("launch/*.py"), ROOT / "scripts/build_interfaces"]
    text = "".join(path.read_text(encoding="utf-8") for path in sources)
    text = re.sub(r'"\s*\n\s*f?"', "", text)  # a message that is broken into lines
    page = PAGES["docs/troubleshooting.md"]
    rows = re.findall(r"^\| (.*?) \|", page.partition("## The result")[0], re.MULTILINE)
    quoted = [message for row in rows for message in re.findall("`([^`]+)`", row)]
    assert len(quoted) > 30
    assert [part for each in quoted for part in re.split(r" ?\.\.\. ?", each) if part.strip() not in text] == []


@pytest.mark.slow
def test_every_dependency_is_listed_with_its_licence():
    check = subprocess.run(
        [sys.executable, ROOT / "scripts/release", "--licences", "--check"], capture_output=True, text=True
    )
    assert check.returncode == 0, check.stdout
    assert "unknown" not in PAGES["docs/dependencies.md"]


def test_the_unit_asks_for_what_it_waits_for():
    unit = (ROOT / "config/systemd/soilmoist.service").read_text(encoding="utf-8")
    after, wants = (re.search(rf"^{key}=(.*)$", unit, re.MULTILINE)[1].split() for key in ("After", "Wants"))
    assert after == wants == ["network-online.target", "time-sync.target"]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed")
def test_systemd_understands_the_unit(tmp_path):
    unit = ROOT / "config/systemd/soilmoist.service"
    found = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    assert "soilmoist.service" not in found.stderr


@pytest.mark.process
@pytest.mark.parametrize("name", ["demo", "test", "docs", "build_interfaces", "keystore", "fuzz", "release"])
def test_the_help_of_a_script_installs_nothing(name, tmp_path):
    shutil.copytree(ROOT / "scripts", tmp_path / "scripts")
    run = subprocess.run([tmp_path / "scripts" / name, "--help"], capture_output=True, text=True, cwd=tmp_path)
    assert (run.returncode, run.stderr) == (0, "")
    assert f"usage: {'.venv/bin/python ' * (name in ('fuzz', 'release'))}scripts/{name}" in run.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["scripts"]


# Required modules ----------------------------------------------------------------------------------------------

COLLECT = """
import sys, pytest
sys.modules["mkdocs"] = None
sys.exit(pytest.main(["-p", "no:cacheprovider", "--collect-only", "test/test_site.py"]))
"""


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.parametrize(
    ("required", "code", "said"),
    [
        ("", pytest.ExitCode.NO_TESTS_COLLECTED, "SKIPPED"),
        ("1", pytest.ExitCode.INTERRUPTED, "ModuleNotFoundError"),
    ],
)
def test_a_missing_module(required, code, said):
    environment = {**os.environ, "MODULES_REQUIRED": required}
    command = [sys.executable, "-c", COLLECT]
    found = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert (found.returncode, said in found.stdout) == (code, True), found.stdout


# The tutorials: notebooks that run from the top to the end -------------------------------------------------------


NOTEBOOKS = sorted((ROOT / "docs" / "tutorials").glob("*.ipynb"))


def cells(path):
    return [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_its_outputs(path):
    assert all((cell["outputs"], cell["execution_count"]) == ([], None) for cell in cells(path))


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("1_log_to_map", "95% interval: 90% of 40 left-out counts lie inside"),
        ("2_compare_strategies", "gcb / lattice: "),
        ("3_own_field_and_strategy", "'gcb', 'thrifty']"),
    ],
)
def test_a_notebook_runs(name, shown, tmp_path):
    pytest.importorskip("nbclient", reason="the tutorials need requirements-docs.txt")
    path = ROOT / "docs" / "tutorials" / f"{name}.ipynb"
    run = subprocess.run(
        [sys.executable, ROOT / "scripts" / "docs", "--notebooks", tmp_path, path],
        cwd=tmp_path, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr  # the kernel's own sockets may complain when it ends
    outputs = [output for cell in cells(tmp_path / path.name) for output in cell["outputs"]]
    assert shown in "".join("".join(output.get("text", ())) for output in outputs)
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= (1 if name.startswith("3") else 2)
    assert [output["text"] for output in outputs if output.get("name") == "stderr"] == []


def test_every_notebook_is_run():
    assert [path.stem for path in NOTEBOOKS] == [
        "1_log_to_map", "2_compare_strategies", "3_own_field_and_strategy"
    ]  # fmt: skip
