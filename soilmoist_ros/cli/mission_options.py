# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Options of ``simulate`` and ``demo``, derived from the declared settings of a mission."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import click

from soilmoist_ros.cli.options import Parsed, named
from soilmoist_ros.simulation import PRESETS, SETTINGS, Setting

if TYPE_CHECKING:
    from soilmoist_ros.sensing import Irrigation
    from soilmoist_ros.simulation import MissionSettings

Command = Callable[..., None]
GROUPS: Mapping[str, str] = {
    "Usual options": "field hours strategy live out",
    "Mission": "dwell preset target threshold robots properties until until_sd until_gain certify travel graph "
    "speed_mps stop_overhead_s min_dwell_s metre_cost_s navigator autostart",
    "Map": "model fit noise local drift_model map_from cell_m",
    "Knowledge": "site earlier prior covariates",
    "Simulation": "person seed time_factor scenario cadence_s footprint_m position_sd_m weather drift drift_hour "
    "series_every_s random_field earlier_surveys persistence covariate_correlation useless_covariates",
    "Output": "console leave",
}
"""Names of the options below each heading of ``--help``, in their order; all others come last."""


class GroupedCommand(click.Command):
    """A command whose help shows its options below the headings of :data:`GROUPS`."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options of each group that the command has."""
        options = {str(one.name): record for one in self.get_params(ctx) if (record := one.get_help_record(ctx))}
        for title, names in GROUPS.items():
            shown = [options.pop(name) for name in names.split() if name in options]
            with formatter.section(title):
                formatter.write_dl([*shown, *(options.values() if title == "Output" else ())])


class _Value(click.ParamType):  # type: ignore[type-arg]
    """Option type that applies the checks of a setting."""

    def __init__(self, setting: Setting) -> None:
        self.name = {int: "integer", float: "number"}.get(setting.kind, "text")
        self._setting = setting

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return self._setting.parsed(value) if isinstance(value, str) else self._setting.checked(value)
        except ValueError as error:
            self.fail(str(error), param, ctx)

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """The permitted values, or their type."""
        name = self._setting.name if self._setting.name in ("field", "strategy", "dwell", "model") else self.name
        return f"[{self._setting.limits}]" if self._setting.choices else name.upper()


def mission_options(
    names: Iterable[str] = tuple(SETTINGS), defaults: Mapping[str, Any] = MappingProxyType({})
) -> Callable[[Command], Command]:
    """Add an option per setting; the command receives the given options as ``choices``.

    :param defaults: defaults of the command that are not those of the settings
    """
    chosen = [SETTINGS[name] for name in names]

    def decorate(command: Command) -> Command:
        @wraps(command)
        def run(*args: Any, **kwargs: Any) -> None:
            given = {one.name: value for one in chosen if (value := kwargs.pop(one.name)) not in (None, ())}
            command(*args, choices={**defaults, **given}, **kwargs)

        wrapped: Command = run
        for one in reversed(chosen):
            wrapped = _option(one, defaults)(wrapped)
        return wrapped

    return decorate


def _option(setting: Setting, defaults: Mapping[str, Any]) -> Callable[[Command], Command]:
    """The option of a setting; ``None`` unless given."""
    default = f"Default: {defaults[setting.name]}." if setting.name in defaults else _default(setting)
    more: dict[str, Any] = {"type": _Value(setting)}
    names, text = setting.option, f"{setting.help} {default}"
    if setting.kind is bool:
        names = f"{names}/--no-{names.removeprefix('--')}"
        more = {"default": None}
    elif setting.kind is tuple:
        text = f"{setting.help} Repeatable."
        more = {"multiple": True, "type": Parsed("field"), "metavar": "FIELD[:WEIGHT]"}
    elif setting.unit:
        first, dot, rest = setting.help.partition(". ")
        text = f"{first.rstrip('.')} [{setting.unit}]. {rest if dot else ''}".strip() + f" {default}"
    return click.option(names, setting.name, help=text.rstrip(), **more)


def _default(setting: Setting) -> str:
    """The default as text; empty if the help states it already."""
    if setting.name in PRESETS["recommended"]:
        of_preset = dict.fromkeys(values[setting.name] for values in PRESETS.values())
        return f"Default: {' or '.join(of_preset)}, by --preset."
    if setting.name == "hours":
        return "Default: the usual time of the field."
    if setting.kind is bool:
        return f"Default: {'yes' if setting.default else 'no'}."
    return "" if setting.default in (None, "") else f"Default: {setting.default}."


irrigation_option = click.option(
    "--site", type=named("site"),
    help="Site file with irrigation keys; only these are used: the simulation calibrates its sensor. "
    "Default: loam, roots to 300 mm, depletion 0.5, efficiency 0.8.",
)  # fmt: skip


def irrigation_of(site: str | None) -> Irrigation | None:
    """The irrigation keys of a site file; ``None`` without one."""
    from soilmoist_ros.sensing import load_site

    return None if site is None else load_site(site).irrigation


def with_graph(choices: dict[str, Any]) -> dict[str, Any]:
    """Options with the travel that a travel graph is for."""
    if (graph := choices.get("graph")) is None or choices.get("travel") == "free":
        return choices
    return {"travel": "graph", **choices, "graph": None if graph == "lattice" else graph}


def chosen_settings(choices: dict[str, Any], irrigation: Irrigation | None = None) -> MissionSettings:
    """Mission settings from options; the mission time defaults to that of the field.

    :param irrigation: its doses give the thresholds where ``dose`` is given; default: that of a simulated site
    """
    from soilmoist_ros.exploration import OF_DOSE, check_thresholds
    from soilmoist_ros.simulation import MissionSettings, simulated_site, surrogate_field

    choices = with_graph(choices)
    if choices.get("threshold") == OF_DOSE:
        site = simulated_site(surrogate_field(choices.get("field", MissionSettings.field)), irrigation=irrigation)
        choices["threshold"] = ",".join(f"{value:.4g}" for value in site.irrigation.dose_thresholds)
    elif choices.get("threshold"):
        check_thresholds(choices["threshold"])
    settings = MissionSettings(**choices)
    if "hours" not in choices:
        settings = MissionSettings(**choices, hours=surrogate_field(settings.field_name).hours)
    settings.check()
    return settings
