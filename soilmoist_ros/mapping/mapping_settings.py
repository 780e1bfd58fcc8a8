# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Settings of a map. Command line, logs, replay and mapper take their settings from this declaration.

To add a setting, add a field to :class:`MappingSettings` and use it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Final

from soilmoist_ros.foundation import InputError

if TYPE_CHECKING:
    from soilmoist_ros.mapping.drift import DriftModel
    from soilmoist_ros.mapping.variogram.fit import FitMethod, NoiseModel
    from soilmoist_ros.mapping.variogram.model import ModelName

FIT_SETTINGS: Final = ("model", "fit", "noise", "drift_model")
"""Settings of the fit of a map that missions have by the same names."""
_UNCHANGED: Final = object()


def _choice(help: str, default: Any, *choices: str, before: Any = _UNCHANGED) -> Any:
    """A field: its help, its default, all permitted values, and its value in versions before it was a choice."""
    before = default if before is _UNCHANGED else before
    return field(default=None, metadata={"help": help, "default": default, "choices": choices, "before": before})


@dataclass(frozen=True, kw_only=True)
class MappingSettings:
    """Settings of a map; ``None`` for the default, or in a replay for that of the robot.

    With ``soft_l1`` the mean rate does not change, whatever ``drift_model`` is.
    """

    model: ModelName | None = _choice(
        "Variogram model: gaussian, exponential, spherical, matern32, matern52, or that of a plug-in.", "matern32"
    )
    fit: FitMethod | None = _choice(
        "Variogram fit: restricted maximum likelihood, or the published robust least squares.",
        "reml", "reml", "soft_l1",
    )  # fmt: skip
    noise: NoiseModel | None = _choice(
        "Rate in the Poisson noise of a sample: local to its place or the mean rate.",
        "local", "local", "mean", before="mean",
    )  # fmt: skip
    drift_model: DriftModel | None = _choice(
        "Whether the mean rate may change during the survey.", "auto", "auto", "off", before="off"
    )
    prior: str | None = _choice(
        "Surveys of other fields that inform the variogram before the counts do: a folder of runs, or a table.",
        None,
    )
    keep_nugget: bool | None = _choice(
        "Map the rate with its micro-scale variation (keep), or its smooth part only (filter).", True
    )
    cell_m: float | None = _choice("Cell size [m].", None)
    merge_radius_m: float | None = _choice(
        "Records within this radius become one sample [m]. Default: a quarter of the footprint.", None
    )

    def values(self, recorded: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Settings by name: what is chosen, else what was recorded, else the default.

        :param recorded: parameters of a mapper, whose version may lack some; ``None`` for none

        >>> MappingSettings(fit="soft_l1").values({"model": "gaussian"})["noise"]
        'mean'
        """
        from soilmoist_ros.mapping.variogram.model import VARIOGRAM_MODELS  # needs numpy, options do not

        found = {}
        for one in fields(MappingSettings):
            value = getattr(self, one.name)
            if value is None and recorded is not None:
                value = recorded.get(one.name, one.metadata["before"])
            value = one.metadata["default"] if value is None else value
            known = VARIOGRAM_MODELS.names() if one.name == "model" else one.metadata["choices"]
            if known and value not in known:
                raise InputError(f"there is no {one.name} {value!r}", f"choose one of: {', '.join(known)}")
            found[one.name] = value
        return found
