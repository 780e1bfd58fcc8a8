# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``model``: variogram and drift of the map as JSON in a std_msgs/String, which saves the planner a fit."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import String

from soilmoist_ros.foundation import read_json
from soilmoist_ros.mapping import (
    Change,
    Changing,
    Drift,
    LocalRate,
    Samples,
    TimedSamples,
    Variogram,
    VariogramFit,
)

_VARIOGRAM: Final = ("model", "nugget", "range_m", "sill", "anisotropy", "angle_deg")
_ARRAYS: Final = ("lag_m", "gamma", "weight", "edges_m")
_SAMPLES: Final = (
    "x", "y", "raw_counts", "effective_exposure_s", "spread_xx", "spread_xy", "spread_yy", "time_s",
    "footprint_radius_m",
)  # fmt: skip


@dataclass(frozen=True)
class Model:
    """Content of a message.

    :param fit: the variogram and how it was fitted, ``None`` before the first fit
    :param cell_m: cell size of the map [m]; field and cell size define the map's grid, see :meth:`Field.grid`
    :param changing: the drift of the mean rate that the map allows for, up to ``stamp_s``, with the samples by
        place and time that the map is made of; ``None`` without a drift
    :param dose_basis: see :meth:`soilmoist_ros.pipeline.FieldSurvey.dose_basis`
    """

    fit: VariogramFit | None
    stamp_s: float
    cell_m: float
    changing: Changing | None = None
    dose_basis: Mapping[str, Any] | None = None


def model_to_message(model: Model) -> String:
    """Message of a model; NaN becomes ``null``."""
    return String(data=json.dumps(_plain(model), allow_nan=False))


def model_from_message(message: String) -> Model:
    """Model of a message; unknown keys are ignored, ``ValueError`` names one that is missing or impossible."""
    try:
        content = read_json(message.data)
    except ValueError as error:
        raise ValueError(f"the model is not JSON: {error}") from None
    if not isinstance(content, Mapping):
        raise ValueError("the model is not a JSON object")
    try:
        return _model(content)
    except KeyError as error:
        raise ValueError(f"the model has no key {error.args[0]!r}") from None
    except (TypeError, OverflowError) as error:
        raise ValueError(f"the model has a value of another kind: {error}") from None


def _plain(model: Model) -> dict[str, Any]:
    fit = model.fit
    if fit is None:
        return {"model": None, "n_samples": 0, "stamp_s": model.stamp_s, "cell_m": model.cell_m}
    return {
        **{name: getattr(fit.variogram, name) for name in _VARIOGRAM},
        "mean_rate": _number(fit.mean_rate),
        "method": fit.method,
        "converged": bool(fit.converged),
        "other_fields": fit.other_fields,
        "n_samples": int(fit.n_samples),
        "stamp_s": model.stamp_s,
        "objective": _number(fit.objective),
        "log_sd": None if fit.log_sd is None else [_number(value) for value in fit.log_sd],
        "prior_share": [_number(value) for value in fit.prior_share],
        **{name: [_number(value) for value in getattr(fit, name)] for name in _ARRAYS},
        "cell_m": model.cell_m,
        "local_rate": None if fit.local_rate is None else _plain_rate(fit.local_rate),
        **_plain_drift(model.changing),
        **({} if model.dose_basis is None else {"dose_basis": model.dose_basis}),
    }


def _plain_drift(changing: Changing | None) -> dict[str, Any]:
    """The drift and its samples, in columns; nothing without a drift."""
    if changing is None or changing.change.drift is None:
        return {}
    samples = changing.timed.samples
    *path, radius_m = samples.spread.T
    columns = (*samples.xy.T, samples.counts, samples.exposure_s, *path, changing.timed.time_s, radius_m)
    table = {name: column.tolist() for name, column in zip(_SAMPLES, columns, strict=True)}
    return {"drift": {**asdict(changing.change.drift), "samples": table}}


def _plain_rate(rate: LocalRate) -> dict[str, Any]:
    """A local rate without its variogram, which is that of the fit."""
    x, y = rate.pools_xy.T
    columns = {"x": x.tolist(), "y": y.tolist(), "coefficients": rate.coefficients.tolist()}
    return {"mean": rate.mean, "least": rate.least, **columns}


def _model(content: Mapping[str, Any]) -> Model:
    stamp_s = float(content["stamp_s"])
    if not math.isfinite(stamp_s):
        raise ValueError(f"stamp_s must be finite, got {stamp_s}")
    cell_m = float(content["cell_m"])
    if not 0 < cell_m < math.inf:
        raise ValueError(f"cell_m must be > 0 and finite, got {cell_m}")
    if content["model"] is None:
        return Model(None, stamp_s, cell_m)
    if content["method"] not in ("reml", "soft_l1"):
        raise ValueError(f"unknown method {content['method']!r}; known are reml, soft_l1")
    variogram = Variogram(*(content[name] for name in _VARIOGRAM))
    fit = VariogramFit(
        variogram,
        content["method"],
        _value(content["mean_rate"]),
        int(content["n_samples"]),
        _value(content["objective"]),
        None if content["log_sd"] is None else _three(content["log_sd"]),
        _three(content["prior_share"]),
        bool(content["converged"]),
        _array(content["lag_m"]),
        _array(content["gamma"]),
        _array(content["weight"]),
        _array(content["edges_m"]),
        local_rate=_local_rate(variogram, content["local_rate"]),
        other_fields=str(content["other_fields"]),
    )
    return Model(fit, stamp_s, cell_m, _changing(content.get("drift"), stamp_s), content.get("dose_basis"))


def _changing(content: Mapping[str, Any] | None, stamp_s: float) -> Changing | None:
    """The drift and its samples."""
    if content is None:
        return None
    times_s, shares, *components = map(_array, (content["times_s"], content["shares"], *content["components"]))
    drift = Drift(
        float(content["probability"]),
        bool(content["is_jump"]),
        _numbers(times_s),
        _numbers(shares),
        tuple(map(_numbers, components)),
    )
    columns = [_array(content["samples"][name]) for name in _SAMPLES]
    x, y, counts, exposure_s, xx, xy, yy, time_s, radius_m = columns
    whole = len({len(column) for column in columns}) == 1
    whole &= len({len(column) for column in (times_s, shares, *components)}) == 1
    sound = np.isfinite([*time_s, *times_s, *shares, *np.ravel(components if whole else ())]).all()
    if not (whole and sound and len(x) and len(times_s) and (np.diff(times_s) > 0).all()):
        raise ValueError("drift must have finite numbers, rising times_s, and columns of equal length")
    samples = Samples(np.column_stack([x, y]), counts, exposure_s, np.column_stack([xx, xy, yy, radius_m]))
    return Changing(TimedSamples(samples, time_s), Change(drift), stamp_s)


def _local_rate(variogram: Variogram, content: Mapping[str, Any] | None) -> LocalRate | None:
    """The rate in the noise of the samples, ``None`` for the mean rate."""
    if content is None:
        return None
    x, y, coefficients = (_array(content[name]) for name in ("x", "y", "coefficients"))
    mean, least = float(content["mean"]), float(content["least"])
    whole = len(x) == len(y) == len(coefficients) and np.isfinite([*x, *y, *coefficients, mean, least]).all()
    if not (whole and least > 0):
        raise ValueError("local_rate must have finite pools of equal numbers, and a lower limit > 0")
    return LocalRate(variogram, mean, least, np.column_stack([x, y]), coefficients)


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _value(item: Any) -> float:
    return math.nan if item is None else float(item)


def _array(items: Any) -> NDArray[np.float64]:
    return np.array([_value(item) for item in items], dtype=float)


def _numbers(values: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(values.tolist())


def _three(items: Any) -> tuple[float, float, float]:
    first, second, third = (_value(item) for item in items)
    return first, second, third
