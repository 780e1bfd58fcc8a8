"""Settings of the demo, and the configuration of its nodes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from soilmoist_ros.recording.run_folder import CONFIGURATION, write_parameters
from soilmoist_ros.simulation.fields.field_files import write_field_file, write_site_file
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.mission.settings import PropertySettings


@dataclass(frozen=True)
class DemoSettings:
    """Settings of a demo.

    :param out: folder of the run; must not hold a run yet
    :param field: surrogate field: a built-in name, or a field file with a truth
    :param strategy: strategy
    :param dwell: dwell rule
    :param hours: simulated time of the mission [h]
    :param speed: simulated time per wall time
    :param seed: seed of all randomness
    :param navigator: ``goto_node`` (Thorvald's navigation) or ``goal_pose``
    :param scenario: faults of navigation and links: a name or a file; empty for none
    :param properties: further properties that are counted and mapped
    """

    out: Path
    field: str = "synthetic-high"
    strategy: str = "gcb"
    dwell: str = "optimal"
    hours: float = 1.0
    speed: float = 60.0
    seed: int = 1
    navigator: str = "goto_node"
    scenario: str = ""
    properties: tuple[PropertySettings, ...] = ()


def write_configuration(settings: DemoSettings, field: SurrogateField, out: Path) -> dict[str, Path]:
    """Write field, site and parameters of the nodes.

    :param settings: settings of the demo
    :param field: the field that is simulated
    :param out: folder of the run
    :returns: parameter files of the nodes by name, in the order of their start
    :raises InputError: if a file cannot be written
    """
    configuration = out / CONFIGURATION
    write_field_file(field, configuration / "field.yaml")
    write_site_file(field, configuration / "site.yaml")
    files = {"field": str(configuration / "field.yaml"), "site": str(configuration / "site.yaml")}
    simulated = {"use_sim_time": True}
    mappers: dict[str, dict[str, object]] = {
        f"{one.name}/mapper": {
            "field": files["field"], "simulated": True, "save_dir": str(out / f"map_{one.name}"), **simulated
        }
        for one in settings.properties
    }  # fmt: skip
    nodes: dict[str, dict[str, object]] = {
        # The first to start and the last to end, so that it records everything.
        "recorder": {"out": str(out), "name": "bag"},
        "mapper": {**files, "simulated": True, "save_dir": str(out / "map"), **simulated},
        **mappers,
        "planner": {
            "field": files["field"],
            "strategy": settings.strategy,
            "dwell": settings.dwell,
            "hours": settings.hours,
            "seed": settings.seed,
            "navigator": settings.navigator,
            "autostart": True,
            "exit_when_finished": True,
            **({"properties": [f"{one.name}:{one.weight}" for one in settings.properties]} if mappers else {}),
            **simulated,
        },
        "field_simulator": {
            "field": _absolute(settings.field),
            **({"properties": [_absolute(one.field) for one in settings.properties]} if mappers else {}),
            "seed": settings.seed,
            "speed": settings.speed,
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
