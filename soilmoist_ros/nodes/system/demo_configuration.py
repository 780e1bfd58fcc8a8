"""Settings of the demo, and the configuration of its nodes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from soilmoist_ros.recording.run_folder import CONFIGURATION, write_parameters
from soilmoist_ros.simulation.fields.field_files import write_field_file, write_site_file
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.mission.settings import MissionSettings


@dataclass(frozen=True)
class DemoSettings:
    """Settings of a demo.

    :param out: folder of the run; must not contain a run yet
    :param mission: the mission; the nodes always map all records and travel on a graph
    :param time_factor: simulated time per real time
    :param navigator: ``goto_node`` (Thorvald's navigation) or ``goal_pose``
    :param scenario: name or file with faults of navigation and links; empty for none
    """

    out: Path
    mission: MissionSettings
    time_factor: float = 60.0
    navigator: str = "goto_node"
    scenario: str = ""


def write_configuration(settings: DemoSettings, field: SurrogateField, out: Path) -> dict[str, Path]:
    """Write field, site and parameters of the nodes.

    :param settings: settings of the demo
    :param field: the simulated field
    :param out: folder of the run
    :returns: parameter files of the nodes by name, in the order of their start
    :raises InputError: if a file cannot be written
    """
    mission, configuration = settings.mission, out / CONFIGURATION
    write_field_file(field, configuration / "field.yaml")
    write_site_file(field, configuration / "site.yaml")
    files = {"field": str(configuration / "field.yaml"), "site": str(configuration / "site.yaml")}
    simulated = {"use_sim_time": True}
    fitted = {"model": mission.model, "fit": mission.fit, "simulated": True, **simulated}
    mappers: dict[str, dict[str, object]] = {
        f"{one.name}/mapper": {
            "field": files["field"], "save_dir": str(out / f"map_{one.name}"), **fitted
        }
        for one in mission.properties
    }  # fmt: skip
    nodes: dict[str, dict[str, object]] = {
        # The recorder starts first and ends last, so that it records everything.
        "recorder": {"out": str(out), "name": "bag"},
        "mapper": {**files, "save_dir": str(out / "map"), **fitted},
        **mappers,
        "planner": {
            "field": files["field"],
            "strategy": mission.strategy,
            "dwell": mission.dwell,
            "hours": mission.hours,
            "seed": mission.seed,
            "preset": mission.preset,
            "navigator": settings.navigator,
            "autostart": True,
            "exit_when_finished": True,
            **({"properties": [f"{one.name}:{one.weight}" for one in mission.properties]} if mappers else {}),
            **simulated,
        },
        "field_simulator": {
            "field": _absolute(mission.field_name),
            **({"properties": [_absolute(one.field_name) for one in mission.properties]} if mappers else {}),
            "seed": mission.seed,
            "speed": settings.time_factor,
            "scenario": settings.scenario,
            "logger_port": 0,
            "gnss_port": 0,
            "ports_file": str(out / "log" / "ports.json"),
        },
        "sensor_driver": {**files, **simulated},
    }
    return {name: write_parameters(out, name, values) for name, values in nodes.items()}


def _absolute(field: str) -> str:
    """The name of a field, or the absolute path of its file."""
    return str(Path(field).absolute()) if Path(field).is_file() else field
