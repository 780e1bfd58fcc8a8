# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Settings of a simulated mission; each is declared once, here.

:data:`SETTINGS` defines command-line options, keys and table columns of campaigns, and all checks.
To add a setting, add a field to :class:`MissionSettings` and use it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from soilmoist_ros.foundation import InputError, Mistake, did_you_mean

if TYPE_CHECKING:
    from soilmoist_ros.exploration import Aim, DwellRule, RobotMotion, Strategy, StrategyKind
    from soilmoist_ros.mapping import DriftModel, FitMethod, ModelName, NoiseModel
    from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
    from soilmoist_ros.simulation.robot.scenario import RateDrift

Preset = Literal["recommended", "paper", "authors"]

_BOTH = {
    "strategy": ("gcb", "greedy"),
    "dwell": ("optimal", "ami:0.03"),
    "model": ("matern32", "gaussian"),
    "fit": ("reml", "soft_l1"),
    "noise": ("local", "mean"),
    "drift_model": ("auto", "off"),
    "map_from": ("records", "stops"),
}
_RECOMMENDED, _PUBLISHED = (
    MappingProxyType({name: both[number] for name, both in _BOTH.items()}) for number in (0, 1)
)
PRESETS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {"recommended": _RECOMMENDED, "paper": _PUBLISHED, "authors": _PUBLISHED}
)
"""Default values of the settings that a preset chooses."""
_UNITS = ("_s_per_rad", "_mps", "_m", "_s")
_KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}


@dataclass(frozen=True)
class Setting:
    """The declaration of a setting."""

    name: str  # with the unit where it is not obvious
    kind: type  # type of a value; ``tuple`` for a list of properties
    default: Any  # ``None`` if the preset or the field chooses it
    help: str  # what it sets, and what happens at its limits
    unit: str = ""  # for tables and help
    low: float | None = None  # smallest value
    above: bool = False  # whether a value must be greater than ``low``
    choices: tuple[str, ...] = ()  # permitted values; any if empty
    registered: Callable[[], Sequence[str]] | None = None  # returns the registered names, when a value is checked
    check: Callable[[Any], Any] | None = None  # returns a value in its plain form, or raises :class:`InputError`
    method: str = ""  # in Python, objects with this method are permitted instead of a name

    @property
    def option(self) -> str:
        """Command-line option: the name without its unit."""
        if self.kind is tuple:
            return "--property"
        stem = next((self.name.removesuffix(end) for end in _UNITS if self.name.endswith(end)), self.name)
        return "--" + stem.replace("_", "-")

    @property
    def limits(self) -> str:
        """Permitted values as text for help; empty if the type is the only limit."""
        if self.choices:
            return "|".join(self.choices)
        if self.low is None:
            return ""
        return f"{'>' if self.above else '>='} {self.low:g}"

    def checked(self, given: Any) -> Any:
        """Check a value and return it in its plain form.

        >>> from soilmoist_ros.simulation.mission.settings import SETTINGS
        >>> SETTINGS["hours"].checked(2)
        2.0
        >>> SETTINGS["dwell"].checked("ami:3%")
        'ami:0.03'
        >>> SETTINGS["robots"].checked(0)
        Traceback (most recent call last):
        ...
        ValueError: must be >= 1, but it is 0

        :raises ValueError: if it is of another type or not permitted
        """
        value: Any = given
        if value is None and self.default is None:
            return None
        if self.method and callable(getattr(value, self.method, None)):
            return value
        if self.kind is float and _is_of(value, int):  # a YAML parser may give an int of its own
            try:
                value = float(value)
            except OverflowError:
                value = math.inf
        if self.kind is not tuple and not _is_of(value, self.kind):
            raise ValueError(f"must be {_KINDS[self.kind]}, but it is {given!r}")
        names = self.choices if self.registered is None else self.registered()
        if names and value not in names:
            raise ValueError(
                f"there is no {self.name} {value!r} -> use one of: {', '.join(names)}{did_you_mean(value, names)}"
            )
        if self.kind is float and not math.isfinite(value):
            raise ValueError(f"must be finite, but it is {value!r}")
        if self.low is not None and not (value > self.low or (value == self.low and not self.above)):
            raise ValueError(f"must be {self.limits}, but it is {value!r}")
        if self.kind is str and not value and self.default != "":
            raise ValueError("must not be empty")
        if self.check is None:
            return value
        try:
            return self.check(value)
        except InputError as error:
            raise ValueError(str(error)) from None

    def parsed(self, text: str) -> Any:
        """Read a value from the text of a command-line option.

        :raises ValueError: if it is not permitted
        """
        if self.kind in (int, float):
            try:
                return self.checked(self.kind(text))
            except ValueError as error:
                if str(error).startswith("must"):
                    raise
                point = f" -> write {text.replace(',', '.')}" if text.replace(",", "", 1).isdecimal() else ""
                raise ValueError(f"must be {_KINDS[self.kind]}, but it is {text!r}{point}") from None
        return self.checked(text)


def _is_of(value: object, kind: type) -> bool:
    """True if a value has a type; truth values do not count as numbers, texts of an enumeration count as texts."""
    return isinstance(value, kind) and isinstance(value, bool) == (kind is bool)


def _strategies() -> Sequence[str]:
    from soilmoist_ros.exploration import STRATEGIES

    return STRATEGIES.names()


def _kind(strategy: Any) -> StrategyKind:
    from soilmoist_ros.exploration import strategy_kind

    return strategy_kind(strategy)


def _models() -> Sequence[str]:
    from soilmoist_ros.mapping import VARIOGRAM_MODELS

    return VARIOGRAM_MODELS.names()


def _plain_dwell(text: str) -> str:
    from soilmoist_ros.exploration import parse_dwell

    return str(parse_dwell(text))


def _plain_person(text: str) -> str:
    from soilmoist_ros.simulation.robot.virtual_navigation import Habits

    return str(Habits.parse(text))


def _plain_aim(text: str) -> str:
    from soilmoist_ros.exploration import Aim

    return text and str(Aim.parse(text))


def _share(value: float) -> float:
    if value > 1:
        raise InputError(f"must be at most 1, but it is {value!r}")
    return value


def _plain_thresholds(text: str) -> str:
    from soilmoist_ros.exploration import OF_DOSE, parse_thresholds

    return text if text == OF_DOSE else ",".join(f"{value:g}" for value in parse_thresholds(text))


def _not_percent(value: float) -> float:
    from soilmoist_ros.exploration import MAX_UNTIL_SD

    if value > MAX_UNTIL_SD:
        raise InputError(f"must be at most {MAX_UNTIL_SD:g}, but it is {value:g}", f"write {value / 100:g}")
    return value


def _properties(value: Any) -> tuple[PropertySettings, ...]:
    many = value if isinstance(value, (list, tuple)) else (value,)
    return tuple(one if isinstance(one, PropertySettings) else PropertySettings.parse(str(one)) for one in many)


def _setting(default: Any, help: str, kind: type | None = None, **about: Any) -> Any:
    return field(default=default, metadata={"kind": kind or type(default), "help": help, **about})


@dataclass(frozen=True)
class PropertySettings:
    """An additional property that the robots measure and map.

    :param field: surrogate field with the true rate: a built-in name, the path of a field file, or the field
    :param weight: value of a share of its variation to the planner, relative to 1 for the mission field; with 0,
        the property is mapped, but not planned for
    """

    field: str | SurrogateField
    weight: float = 1.0

    @classmethod
    def parse(cls, text: str) -> PropertySettings:
        """Read ``FIELD`` or ``FIELD:WEIGHT``.

        >>> PropertySettings.parse("rough:0.5")
        PropertySettings(field='rough', weight=0.5)

        :raises InputError: if there is no field, or the weight is not a number from 0
        """
        field, colon, number = text.rpartition(":")
        if not colon or "/" in number or "\\" in number:  # no weight, but a path with a colon
            field, number = text, "1"
        try:
            weight = float(number)
        except ValueError:
            weight = math.nan
        if not field or not (math.isfinite(weight) and weight >= 0):
            raise InputError(
                f"{text!r} is not a property with a weight", "give FIELD or FIELD:WEIGHT with a weight from 0"
            )
        return cls(field, weight)

    @property
    def name(self) -> str:
        """Name in topics and files."""
        from soilmoist_ros.exploration import property_name  # with numpy, which a help does not need

        return property_name(self.field_name)

    @property
    def field_name(self) -> str:
        """Name or path of the field."""
        return self.field if isinstance(self.field, str) else self.field.name

    def __str__(self) -> str:
        return self.field_name if self.weight == 1 else f"{self.field_name}:{self.weight:g}"


@dataclass(frozen=True)
class MissionSettings:
    """Everything that determines a simulated mission, bit for bit.

    The preset chooses settings that are not given, see :data:`PRESETS`. Two settings are equal if they describe
    the same mission.

    >>> MissionSettings().strategy, MissionSettings(preset="paper").strategy
    ('gcb', 'greedy')
    >>> MissionSettings(preset="paper", model="matern32").model
    'matern32'

    :data:`SETTINGS` describes each setting, for instance ``SETTINGS["dwell"].help``.
    """

    field: str | SurrogateField = _setting(
        "synthetic-high", "Field to explore: a built-in one, or a field file with a truth.", method="rate_at"
    )
    strategy: str | Strategy | type[Strategy] = _setting(
        None,
        "How the next stop is chosen: greedy, monte_carlo, adaptive_sampling, random, lattice, two_pass, gcb, "
        "or the strategy of a plug-in.",
        str,
        registered=_strategies,
        method="choose",
    )
    dwell: str | DwellRule = _setting(
        None, "Time at a stop: fmi:SECONDS (fixed), ami:THRESHOLD (until 1/sqrt(counts) falls to it) or optimal "
        "(as the strategy plans, or 60 s). Thresholds take the counts of --field.", str, check=_plain_dwell,
        method="enough",
    )  # fmt: skip
    hours: float = _setting(2.0, "Mission time.", unit="h", low=0, above=True)
    seed: int = _setting(1, "Seed of all randomness.", low=0)
    model: ModelName = _setting(
        None,
        "Variogram model: gaussian, exponential, spherical, matern32, matern52, or the model of a plug-in.",
        str,
        registered=_models,
    )
    fit: FitMethod = _setting(
        None, "Variogram fit: restricted maximum likelihood, or the published robust least squares.", str,
        choices=("reml", "soft_l1"),
    )  # fmt: skip
    noise: NoiseModel = _setting(
        None, "Rate in the Poisson noise of a sample: local to its place, or the mean rate as published.", str,
        choices=("local", "mean"),
    )  # fmt: skip
    drift_model: DriftModel = _setting(
        None, "Whether the mean rate may change during the survey, by drying or rain, where the counts ask for it "
        "(auto), or never (off). The map is of the end.", str, choices=("auto", "off"),
    )  # fmt: skip
    prior: str | None = _setting(
        None, "Surveys of other fields that inform the variogram before the counts do: a folder of runs, or a "
        "table of them.", str,
    )  # fmt: skip
    preset: Preset = _setting(
        "recommended", "Settings where none are given: the recommended ones, those of the paper, or those of the "
        "authors' experiments, with the constants of its strategies.", choices=tuple(PRESETS),
    )  # fmt: skip
    map_from: Literal["stops", "records"] = _setting(
        None, "What is mapped: the counts at the stops only, as published, or all records.", str,
        choices=("stops", "records"),
    )  # fmt: skip
    target: Literal["rate", "vwc", "decision"] = _setting(
        "rate", "What the map is to be good for: the rate; the moisture, whose error grows in wet soil; or the "
        "zones by --threshold. Then the mission also ends when hardly any place is in the wrong zone.",
        choices=("rate", "vwc", "decision"),
    )  # fmt: skip
    threshold: str | None = _setting(
        None, "Thresholds between the zones, such as 0.15 or 0.15,0.25, for target decision: moisture in m3/m3 "
        "or % where it is calibrated, else counts/s; dose: those between the doses of the site file.", str,
        check=_plain_thresholds,
    )  # fmt: skip
    travel: Literal["free", "graph", "lanes"] = _setting(
        "free", "Travel in straight lines, on a travel graph, or on lanes as a car, which turns around only at "
        "their ends and junctions.", choices=("free", "graph", "lanes"),
    )  # fmt: skip
    graph: str | None = _setting(
        None, "Topological map to travel on, or tracks as lines in GeoJSON, GPX, KML or shapefile. "
        "Default: an open lattice of about 300 nodes.", str,
    )  # fmt: skip
    speed_mps: float = _setting(0.6, "Speed of the robot.", unit="m/s", low=0, above=True)
    stop_overhead_s: float = _setting(12.0, "Time lost at each stop.", unit="s", low=0)
    min_dwell_s: float | None = _setting(
        None, "Shortest time at a stop, whatever the dwell rule says; stops that leave less are skipped. Default: "
        "one record.", float, unit="s", low=0, above=True,
    )  # fmt: skip
    metre_cost_s: float = _setting(
        0.0, "Time that it is worth to avoid a metre: the planner drives less.", unit="s/m", low=0
    )
    person: str | None = _setting(
        None, "A person carries the sensor, and judges advice: obedient, usual (0.1,0.1,0.1), or probabilities on "
        "each trip of a pause, a wrong turn and a stop of their own. Default: a robot.", str,
        check=_plain_person,
    )  # fmt: skip
    cadence_s: float = _setting(10.0, "Duration of a record.", unit="s", low=0, above=True)
    cell_m: float | None = _setting(
        None, "Cell size of the map. Default: the field's.", float, unit="m", low=0, above=True
    )
    footprint_m: float = _setting(0.0, "Radius of the sensor's footprint; 0: a point sensor.", unit="m", low=0)
    position_sd_m: float = _setting(0.02, "Noise of each coordinate of the GNSS receiver.", unit="m", low=0)
    weather: bool = _setting(True, "Let the weather change, and correct the counts for it.")
    drift: float = _setting(
        0.0, "Change of the true rate during the mission, the same share everywhere: 0.1 for drying by 10 %, "
        "negative for wetting. A map is compared with the truth of its time.", low=-1, above=True,
    )  # fmt: skip
    drift_hour: float | None = _setting(
        None, "Hour of the mission at which the drift happens, within five minutes, as with rain. Default: evenly "
        "over the mission.", float, unit="h", low=0,
    )  # fmt: skip
    series_every_s: float = _setting(
        60.0, "Time between entries of the series; each map of stops is entered as well.", unit="s", low=0,
        above=True,
    )  # fmt: skip
    robots: int = _setting(
        1, "Robots that share one map. They start apart near a corner of the field; each avoids the stops of the "
        "others, and collisions are not simulated.", low=1,
    )  # fmt: skip
    until_sd: float = _setting(
        0.0, "End when the standard deviation of the map is at most this. With target rate a share of the mean "
        "rate (0.02: 2 %), with target vwc in m3/m3; 0: never.", low=0, check=_not_percent,
    )  # fmt: skip
    until_gain: float = _setting(
        0.0, "End when the standard deviation of the map will fall by less than this in ten minutes; 0: never.",
        unit="%", low=0,
    )  # fmt: skip
    certify: int = _setting(
        0, "Number of places of a certificate: drawn at random before the mission, counted at whatever the "
        "strategy, and compared with the map. They state its mean and its error without a model; at least 5, and "
        "0 for none.", low=0,
    )  # fmt: skip
    until: str = _setting(
        "", "Plan the shortest mission in which the map becomes this good, and end it then: p95-sd=0.02 (standard "
        "deviation on 95 % of the field), sd=2% (on its mean), both of the moisture in m3/m3 where the sensor is "
        "calibrated, else as a share of the mean rate; sd=5% rate; zone=0.85 (probability that a place is in the "
        "third of the field, from dry to wet, in which the map has it).", check=_plain_aim,
    )  # fmt: skip
    random_field: bool = _setting(
        False, "Draw what is random in the field (patches, random fields) from the seed as well."
    )
    earlier_surveys: int = _setting(
        0, "Number of earlier surveys of each field that inform its map: about 100 stops of 70 s each, and "
        "its own mean. The present field is the same with and without them.", low=0,
    )  # fmt: skip
    persistence: float = _setting(
        0.9, "Correlation of the patterns of two surveys: 1 if nothing but the mean changes, 0 if the earlier "
        "surveys say nothing about this one.", low=0, check=_share,
    )  # fmt: skip
    covariate_correlation: float | None = _setting(
        None, "Correlation of a simulated covariate with the truth, from -1 to 1. The map knows the values, but "
        "not the correlation. Default: no covariate.", float, low=-1, check=_share,
    )  # fmt: skip
    useless_covariates: int = _setting(
        0, "Number of simulated covariates that have nothing to do with the truth, but are as smooth.", low=0
    )
    properties: tuple[PropertySettings, ...] = _setting(
        (), "Further property that the robots count and map: a built-in field, or a field file with a truth, on "
        "the same ground. The planner gives it this weight, --field has 1; with 0 it is mapped only.",
        check=_properties,
    )  # fmt: skip

    def __post_init__(self) -> None:
        for name, value in PRESETS.get(self.preset, _RECOMMENDED).items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        object.__setattr__(self, "properties", _properties(self.properties))

    def check(self) -> None:
        """Check every setting and the combinations.

        :raises InputError: with every mistake
        """
        from soilmoist_ros.exploration import check_places, check_target

        mistakes = []
        for setting in SETTINGS.values():
            try:
                setting.checked(getattr(self, setting.name))
            except ValueError as error:
                mistakes.append(Mistake(f"{setting.name}: {error}"))
        if self.travel == "free" and self.graph is not None:
            text = "a travel graph is given, but the robot travels freely"
            mistakes.append(Mistake(text, "choose travel graph"))
        if self.until and self.until_sd > 0:
            mistakes.append(Mistake("until and until_sd are both given", "give one of them"))
        if self.travel == "lanes" and self.graph is None:
            mistakes.append(Mistake("travel lanes needs a file of lanes", "give it as graph"))
        checks = (check_places, (self.certify, self.robots)), (check_target, (self.target, self.threshold))
        for check, values in checks:
            try:
                check(*values)
            except InputError as error:
                mistakes += error.mistakes
        if self.drift_hour is not None and self.drift == 0:
            text = "an hour of the drift is given, but the rate does not drift"
            mistakes.append(Mistake(text, "give drift, for rain -0.1"))
        if self.target == "decision" and self.strategy in _strategies() and not _kind(self.strategy).decides:
            able = ", ".join(name for name in _strategies() if _kind(name).decides)
            text = f"strategy {self.strategy} does not plan for a decision"
            mistakes.append(Mistake(text, f"choose one of: {able}"))
        if mistakes:
            raise InputError(mistakes)

    @property
    def motion(self) -> RobotMotion:
        """Motion of the robots, and what avoiding a stop or a metre is worth."""
        from soilmoist_ros.exploration import RobotMotion

        return RobotMotion(self.speed_mps, self.stop_overhead_s, self.metre_cost_s)

    @property
    def aim(self) -> Aim | None:
        """Quality that the map must have, by :attr:`until`."""
        from soilmoist_ros.exploration import Aim

        return Aim.parse(self.until) if self.until else None

    def of_moisture(self, calibrated: bool) -> bool:
        """True if plans improve the map of the moisture.

        :raises InputError: if the aim needs a calibration that is missing
        """
        return self.target != "rate" if self.aim is None else self.aim.wants_moisture(self.target, calibrated)

    @property
    def rate_drift(self) -> RateDrift:
        """Change of the true rate with time."""
        from soilmoist_ros.simulation.robot.scenario import RAIN_S, RateDrift

        if self.drift_hour is None:
            return RateDrift(self.drift, 0.0, 3600 * self.hours)
        return RateDrift(self.drift, 3600 * self.drift_hour, 3600 * self.drift_hour + RAIN_S)

    @property
    def field_name(self) -> str:
        """Name or path of the field."""
        return PropertySettings(self.field).field_name

    @property
    def _named(self) -> dict[str, str]:
        """Names of the settings that may be objects."""
        strategy, kind = self.strategy, self.strategy if isinstance(self.strategy, type) else type(self.strategy)
        return {
            "field": self.field_name,
            "strategy": strategy if isinstance(strategy, str) else kind.__name__,
            "dwell": str(self.dwell),
        }

    def as_dict(self) -> dict[str, Any]:
        """All settings by name, as plain values."""
        properties = [{"field": one.field_name, "weight": one.weight} for one in self.properties]
        return {name: getattr(self, name) for name in SETTINGS} | self._named | {"properties": properties}

    def as_texts(self) -> dict[str, Any]:
        """All settings by name, as cells of a table: numbers, truth values and texts."""
        properties = " ".join(map(str, self.properties)) or "none"
        plain = self.as_dict()
        missing = {name: "none" for name, one in SETTINGS.items() if one.kind is str and not plain[name]}
        texts = {"graph": self.graph or "default", "person": self.person or "robot", "properties": properties}
        return plain | missing | texts

    def __str__(self) -> str:
        usual, always = MissionSettings(preset=self.preset).as_texts(), ("field", "strategy", "dwell", "seed")
        shown = {name: value for name, value in self.as_texts().items() if value != usual[name] or name in always}
        return " ".join(f"{name}={value}" for name, value in shown.items())


SETTINGS: Mapping[str, Setting] = MappingProxyType(
    {one.name: Setting(one.name, default=one.default, **one.metadata) for one in fields(MissionSettings)}
)
"""The declaration of each setting by its name."""
