# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The command as a user runs it: map.py, simulate.py, replay.py, demo.py, calibrate.py, mission_options.py ...."""

import json
import re
import shlex
import subprocess
import sys

import click
import pytest
import rasterio
import rasterio.warp
from click.testing import CliRunner

from soilmoist_ros.cli.main import COMMANDS, EXAMPLES, RENAMED, main
from soilmoist_ros.cli.mission_options import GROUPS
from soilmoist_ros.foundation.configuration import config_folder, resource_names
from soilmoist_ros.sensing.moisture.site import load_site
from soilmoist_ros.simulation.mission.settings import SETTINGS
from virtual_survey import write_survey

OUTPUTS = ["map.tif", "records.csv", "report.html", "samples.geojson", "soilmoist.qgs", "summary.json"]


def run(*arguments):
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    folder = tmp_path_factory.mktemp("survey")
    write_survey(folder, seed=2, spacing_m=15.0, dwell_s=60.0)
    return folder


def survey_options(survey, out):
    return ["--nmea", survey / "survey.nmea", "--site", survey / "site.yaml", "--out", out]


@pytest.mark.slow
def test_the_map_of_a_survey_is_close_to_the_truth(survey, tmp_path):
    options = survey_options(survey, tmp_path / "out")
    result = run("map", survey / "survey.log", "--field", survey / "field.yaml", *options)
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == OUTPUTS
    with rasterio.open(tmp_path / "out" / "map.tif") as raster:
        assert {"vwc_sd", "rate", "rate_sd"} < set(raster.descriptions)
        assert raster.crs.to_epsg() == 32630
        vwc = raster.read(raster.descriptions.index("vwc") + 1, masked=True)
    assert vwc[:, :20].mean() == pytest.approx(0.08, abs=0.03)
    assert vwc[:, -20:].mean() == pytest.approx(0.28, abs=0.05)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["simulated"] is True
    assert "SIMULATED" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.slow
def test_the_real_roving_record_is_mapped_by_the_documented_command(roving_record, tmp_path):
    log = roving_record
    result = run("map", log, "--site", "gypsum_transect", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "warning    The calibration is illustrative" in result.output
    assert "mean soil water content (90 % interval, level not known)" in result.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["n_records"] == 200
    assert summary["simulated"] is False
    with rasterio.open(tmp_path / "out" / "map.tif") as raster:
        assert raster.crs.to_epsg() == 32614
        west, south, east, north = rasterio.warp.transform_bounds(raster.crs, "EPSG:4326", *raster.bounds)
    assert -97.5 < west < east < -97.3
    assert 38.6 < south < north < 38.8


def test_every_mistake_in_bad_files_is_reported_with_exit_code_2(tmp_path):
    (tmp_path / "site.yaml").write_text("soil: {bulk_densty_gcm3: 1.4}\nnmae: x\n")
    (tmp_path / "field.yaml").write_text("polygon: [[0, 0], [1, 1]]\n")
    result = run(
        "check", "--site", tmp_path / "site.yaml", "--field", tmp_path / "field.yaml", "--logger", "finap"
    )
    assert result.exit_code == 2
    for expected in ("bulk_densty_gcm3", "'nmae'", "did you mean 'name'?", "polygon", "'finapp'"):
        assert expected in result.output


@pytest.mark.slow
def test_every_shipped_file_passes_the_check():
    options = []
    for kind, option in (("loggers", "--logger"), ("sites", "--site"), ("fields", "--field")):
        for name in resource_names(kind):
            options += [option, config_folder() / kind / f"{name}.yaml"]
    result = run("check", *options)
    assert result.exit_code == 0, result.output
    assert result.output.count("ok: ") == len(options) / 2


def test_an_unreadable_log_exits_with_2_and_leaves_no_folder(tmp_path):
    (tmp_path / "log.txt").write_bytes(b"hello,world\n1,2\n")
    result = run("map", tmp_path / "log.txt", "--out", tmp_path / "out")
    assert (result.exit_code, "log.txt" in result.output, "--logger" in result.output) == (2, True, True)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_calibration_with_weights_and_the_universal_curve_in_a_window_of_time(survey, tmp_path):
    cores, site = tmp_path / "cores.csv", tmp_path / "site.yaml"
    cores.write_text("profile,distance_m,top_cm,bottom_cm,vwc\na,2,0,10,0.20\na,2,10,30,0.10\nb,8,0,10,0.18\n")
    site.write_text("soil: {bulk_density_gcm3: 1.4}\n")
    common = ["calibrate", cores, "--site", site, "--log", survey / "survey.log"]
    result = run(*common, "--from", "1999-01-01", "--to", "1999-01-02")
    assert result.exit_code == 2
    assert "has no record between these times -> the log lasts from 20" in result.output
    text = "# ours\nsoil: {bulk_density_gcm3: 1.4}\ncalibration: {n0_cps: 0.1}\n"
    site.write_text(text)
    assert run(*common, "--dry-run").exit_code == 0
    assert site.read_text() == text
    result = run(*common, "--from", "1999-01-01", "--curve", "universal")
    assert result.exit_code == 0, result.output
    assert site.read_text().startswith("# ours\n")
    assert run("check", "--site", site).exit_code == 0
    assert "3 in 2 profiles" in result.output
    assert "revised weights, seen to" in result.output
    assert load_site(site).calibration.curve == "universal"
    assert load_site(site).curve.parameters["curve"] == "universal"
    result = run("calibrate", cores, "--site", site, "--counts", 9, "--exposure", 9, "--from", "1999-01-01")
    assert "require --log" in result.output


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_lists_each_command_with_its_first_sentence(name):
    command = main.get_command(click.Context(main), name)
    assert command.name == name
    assert " ".join(command.help.split("\n\n")[0].split()).startswith(COMMANDS[name])
    assert COMMANDS[name].split()[0] in run("--help").output


@pytest.mark.parametrize("name", ["simulate", "demo"])
def test_the_help_of_a_mission_groups_its_options(name):
    text = run(name, "--help").output
    assert not re.search(r"Default:\s+\.", text), "no empty default"
    assert re.findall(r"^([A-Z][a-z ]+):$", text, re.MULTILINE) == list(GROUPS)
    usual = text.partition("Usual options:")[2].partition("Mission:")[0]
    wanted = ["--field", "--hours", "--strategy", *["--live"] * (name == "simulate"), "--out"]
    assert re.findall(r"^  (--\w+)", usual, re.MULTILINE) == wanted
    command = main.get_command(click.Context(main), name)
    shown = re.findall(r"^  (?:-\w, )?(--[\w-]+)", text, re.MULTILINE)
    assert sorted(shown) == sorted(
        next(opt for opt in one.opts if opt.startswith("--")) for one in command.get_params(click.Context(command))
    ), "each option once"


def test_an_unknown_command_suggests_the_nearest():
    result = run("simulat")
    assert result.exit_code == 2
    assert "there is no command 'simulat' (did you mean 'simulate'?)" in result.output


@pytest.mark.parametrize(
    ("command", "option"),
    [
        ("simulate", "--also"),
        ("demo", "--speed"),
        ("replay", "--live"),
        ("replay", "--speed"),
        ("export", "--formats"),
        ("export", "--step"),
        ("export", "--zones"),
        ("replay", "--source"),
        ("replay", "--property"),
        ("simulate", "--turn"),
        ("map", "--reference"),
        ("campaign", "--scheduler"),
    ],
)
def test_options_of_earlier_releases_are_errors_that_name_the_new_ones(command, option, tmp_path):
    result = run(command, option, "1", "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert f"there is no option {option} any more: {RENAMED[option]}" in result.output


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_the_examples_of_the_help_are_commands(name):
    command, words = main, name.split()
    for word in words:
        command = command.get_command(click.Context(command), word)
    help_text = run(*words, "--help").output
    for example in EXAMPLES[name]:
        assert f"  soilmoist {example}" in help_text
        group, rest = main, shlex.split(example)
        while isinstance(group, click.Group):
            group, rest = group.get_command(click.Context(group), rest[0]), rest[1:]
        assert isinstance(group.make_context(name, rest), click.Context)


def test_one_option_means_one_thing():
    """Options of one name have the same type in all commands, apart from those that differ on purpose."""
    settings = {setting.option for setting in SETTINGS.values()}  # their types are those of the settings
    on_purpose = {"--to", "--site", "--logger"} | settings
    kinds = {}
    for name in COMMANDS:
        command = main.get_command(click.Context(main), name)
        parts = command.commands.values() if isinstance(command, click.Group) else [command]
        for option in (each for part in parts for each in part.params if isinstance(each, click.Option)):
            assert not option.hidden
            assert option.help
            for spelling in option.opts:
                kinds.setdefault(spelling, set()).add((option.type.name, option.multiple))
    assert {name for name, found in kinds.items() if len(found) > 1} <= on_purpose


@pytest.mark.process
def test_no_help_imports_heavy_libraries():
    code = (
        "import sys; from soilmoist_ros.cli.main import COMMANDS, main\n"
        "for words in [[], *([name] for name in COMMANDS), ['bag', 'play']]:\n"
        "    try: main([*words, '--help'])\n"
        "    except SystemExit: pass\n"
        "print('heavy:', *({'numpy', 'scipy', 'matplotlib', 'rasterio', 'pydantic', 'rich'} & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "--field" in out
    assert out.rstrip().endswith("heavy:")


@pytest.mark.slow
def test_a_mission_is_simulated_with_all_its_outputs(tmp_path):
    out = tmp_path / "out"
    result = run("simulate", "--field", "synthetic-high", "--strategy", "gcb", "--dwell", "fmi:120",
                 "--hours", 0.5, "--cell", 2, "--seed", 3, "--target", "decision", "--threshold", "20%,0.15",
                 "--out", out)  # fmt: skip
    assert result.exit_code == 0, result.output
    for line in (
        r" +Standard deviation of the map: .*; forecast at 25 % of the time: ±\S+ % \(\S+ to \S+\)",
        "decision   below 15 %: .*; 15 to 20 %: .*; above 20 %: .* of the field",
        " +Expected in the wrong zone: .* by the simulated truth it is .*",
    ):
        assert len(re.findall(f"^{line}$", result.output, re.MULTILINE)) == 1
    assert "irrigation Simulated: " in result.output or "irrigation Next: " in result.output
    assert sorted(path.name for path in out.iterdir()) == sorted([*OUTPUTS, "series.csv", "visits.csv"])
    header, *rows = (out / "series.csv").read_text().splitlines()
    assert {"time_s", "distance_m", "samples", "mse", "coverage95"} <= set(header.split(","))
    assert float(rows[-1].split(",")[0]) == pytest.approx(1800, abs=150)
    assert json.loads((out / "summary.json").read_text())["simulated"] is True


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--property", "patches"], "does not cover the field 'synthetic-high'"),
        (["--property", "rough:-1"], "'rough:-1' is not a property with a weight"),
        (["--robots", "0"], "must be >= 1, but it is 0"),
        (["--field", "sinthetic-high"], "did you mean 'synthetic-high'"),
        (["--dwell", "ami:3"], "did you mean 'ami:3%'"),
        (["--graph", "missing.yaml"], "missing.yaml"),
        (["--target", "decision", "--threshold", "15%,0.15"], "name 15 % twice"),
        (["--target", "decision", "--threshold", "0.2", "--field", "smooth"], "looks like a moisture"),
    ],
)
def test_bad_missions_exit_with_2_and_a_remedy(tmp_path, options, message):
    result = run("simulate", *options, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert message in result.output
    assert not (tmp_path / "out").exists()


def test_a_mission_without_a_map_is_reported(tmp_path):
    result = run("simulate", "--hours", 0.05, "--preset", "paper", "--strategy", "random", "--out", tmp_path)
    assert result.exit_code == 1, result.output
    assert "no map: the mission ended before the first map update; report.html says what to do" in result.output
    assert "nan" not in result.output
    names = ["records.csv", "report.html", "series.csv", "summary.json", "visits.csv"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names


def test_an_unknown_field_lists_the_known_fields(tmp_path):
    result = run("graph", "sinthetic-high", "--out", tmp_path / "graph.yaml")
    assert result.exit_code == 2
    assert "half-wet" in result.output
    assert "patches" in result.output
    assert "did you mean 'synthetic-high'" in result.output
    assert run("graph", "example", "--out", tmp_path / "graph.yaml").exit_code == 0
    again = run("graph", "example", "--out", tmp_path / "graph.yaml")
    assert again.exit_code == 2
    assert "graph.yaml: exists already -> choose another file, or give --overwrite" in again.output
    assert run("graph", "example", "--out", tmp_path / "graph.yaml", "--force").exit_code == 0
    lattice = run("graph", "example", "--heading", 20, "--out", tmp_path / "graph.yaml", "--force")
    assert lattice.exit_code == 2
    assert "--heading is for crop rows: it requires --rows" in lattice.output


def test_built_graphs_keep_the_radius_that_the_planner_keeps():
    pytest.importorskip("rclpy")
    from soilmoist_ros.cli.check import command as check
    from soilmoist_ros.cli.graph import command as graph
    from soilmoist_ros.nodes.planner_parameters import PARAMETERS

    planner = next(row.default for row in PARAMETERS if row.name == "robot_radius_m")
    for command, name in ((graph, "margin"), (check, "robot_radius_m")):
        assert planner == next(option.default for option in command.params if option.name == name)


def test_a_graph_of_a_field_that_is_divided_says_so(tmp_path):
    field = tmp_path / "field.yaml"
    field.write_text(
        "datum: {latitude_deg: 53, longitude_deg: 0}\npolygon: [[0, 0], [80, 0], [80, 60], [0, 60]]\n"
        "no_go: [[[30, 1], [32, 1], [32, 99], [30, 99]]]\n"
    )
    result = run("graph", field, "--out", tmp_path / "graph.yaml")
    assert result.exit_code == 0
    assert "divide the field into 2 parts" in result.output
    assert "0.27 ha about (56, 30), 0.17 ha about (15, 30)" in result.output
    bridge = run("graph", field, "--margin", "0.4", "--out", tmp_path / "graph.yaml", "--overwrite")
    assert "divide" not in bridge.output


@pytest.mark.slow
def test_results_are_not_replaced_without_a_word(tmp_path):
    """The refusal comes before the work, and --overwrite replaces results of this package only."""
    (tmp_path / "summary.json").write_text('{"software": "soilmoist_ros", "title": "Mine"}')
    (tmp_path / "bag").mkdir()
    log = tmp_path / "a.log"
    log.write_text("x")
    for command in (["map", log], ["replay", log], ["simulate", "--field", "patches"], ["campaign", "paper"]):
        result = run(*command, "--out", tmp_path)
        assert result.exit_code == 2
        assert "has the results of a run (Mine, of unknown date)" in result.output
        assert "--overwrite" in result.output
    (tmp_path / "report.html").write_text("mine")
    (tmp_path / "summary.json").unlink()
    result = run("simulate", "--field", "patches", "--overwrite", "--out", tmp_path)
    assert result.exit_code == 2
    assert "report.html is not of a run of soilmoist" in result.output
    assert (tmp_path / "report.html").read_text() == "mine"


def test_the_recording_of_a_robot_is_never_replaced(tmp_path):
    pytest.importorskip("rclpy")
    (tmp_path / "bag").mkdir()
    result = run("demo", "--overwrite", "--out", tmp_path)
    assert result.exit_code == 2
    assert "has a recording that is not of a demo" in result.output
    (tmp_path / "configuration").mkdir()
    (tmp_path / "configuration" / "field_simulator.yaml").write_text("")
    result = run("demo", "--out", tmp_path)
    assert result.exit_code == 2
    assert "give --overwrite" in result.output
    assert (tmp_path / "bag").is_dir()


@pytest.mark.slow
def test_a_campaign_replaces_a_run_as_a_whole(tmp_path):
    plan, out = tmp_path / "plan.yaml", tmp_path / "out"
    plan.write_text("title: x\nruns: 1\nexperiments: [{name: a, field: synthetic-high, cell_m: 5000}]\n")
    out.mkdir()
    for name in ("map.tif", "notes.txt"):
        (out / name).write_text("old")
    (out / "summary.json").write_text('{"software": "soilmoist_ros", "outputs": ["summary.json", "map.tif"]}')
    assert run("campaign", plan, "--workers", 0, "--out", out).exit_code == 2
    assert run("campaign", plan, "--workers", 0, "--out", out, "--overwrite").exit_code == 1, "no mission finishes"
    assert (out / "notes.txt").exists()
    assert not {"map.tif", "summary.json"} & {path.name for path in out.iterdir()}


@pytest.mark.slow
def test_the_missions_of_another_campaign_are_not_replaced(tmp_path):
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "0123.npz").write_text("")
    result = run("campaign", "paper", "--out", tmp_path)
    assert result.exit_code == 2
    assert "has the results of another campaign" in result.output


@pytest.mark.slow
def test_a_wrong_reference_system_is_found_before_the_work(roving_record, tmp_path):
    result = run(
        "map", roving_record, "--site", "gypsum_transect", "--crs", "EPSG:27700", "--out", tmp_path / "out"
    )
    assert result.exit_code == 2
    assert "deg from the field" in result.output
    assert "fitting" not in result.output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ["map", "simulate"])
def test_knowledge_that_cannot_be_read_is_found_before_the_work(command, tmp_path):
    (tmp_path / "relief.tif").write_text("no raster")
    (tmp_path / "soils.geojson").write_text("no polygons")
    (tmp_path / "empty").mkdir()
    (tmp_path / "no.log").write_text("no log and no bag\n")
    given = [] if command == "simulate" else [tmp_path / "no.log"]
    knowledge = ["--covariate", tmp_path / "relief.tif", "--covariate", tmp_path / "soils.geojson"]
    result = run(command, *given, *knowledge, "--earlier", tmp_path / "empty", "--out", tmp_path / "out")
    assert result.exit_code == 2
    for message in ("cannot be read as a raster", "cannot be read as polygons", "is neither a run"):
        assert message in result.output
    assert result.output.count("error:") == 3, "and nothing of the log, which was not read"


@pytest.mark.process
@pytest.mark.parametrize(
    ("arguments", "messages"),
    [
        (["map", "no.log", "--site", "nosite"],
         ["no.log: there is no such file -> check the path", "name 'nosite'"]),
        (["simulate", "--covariate", "no.tif:slope", "--earlier", "none", "--covariate", "no.gpkg"],
         ["no.tif: there is no such file of covariates -> check its path", "no.gpkg: there is"]),
        (["map", "a.log", "--out", "a.log/out"],
         ["a.log: is a file, not a folder -> choose another output folder"]),
        (["simulate", "--field", "nofield"], ["there is no surrogate field or field file 'nofield'"]),
        (["calibrate", "no.csv", "--site", "no.yaml"], ["no.csv: there is", "no.yaml: there is"]),
    ],
)  # fmt: skip
def test_what_is_missing_is_found_before_anything_heavy_is_loaded(arguments, messages, tmp_path):
    (tmp_path / "a.log").write_text("x\n")
    out = [] if "--out" in arguments or arguments[0] == "calibrate" else ["--out", "out"]
    code = (
        "import sys; from soilmoist_ros.cli.main import main\n"
        "try: main(sys.argv[1:])\n"
        "finally: print('heavy:', *({'matplotlib', 'rasterio', 'shapely', 'pykrige', 'rich'} & set(sys.modules)))"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, *arguments, *out], cwd=tmp_path, capture_output=True, text=True
    )
    assert result.returncode == 2
    assert all(message in result.stderr for message in messages), result.stderr
    assert result.stdout.rstrip().endswith("heavy:")


def test_a_guided_survey_on_lanes_needs_their_file(tmp_path):
    links = [f"--{one}-uri=tcp://127.0.0.1:1" for one in ("logger", "gnss")]
    result = run("guide", "--field", "patches", *links, "--travel", "lanes", "--port", "0", "--out", str(tmp_path))
    assert result.exit_code == 2
    assert "travel lanes needs a file of lanes -> give it as graph" in result.output
