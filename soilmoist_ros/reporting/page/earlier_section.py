# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The part of a report on earlier surveys: which informed the map, what they contributed, and what has changed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from soilmoist_ros.mapping import FALSE_SHARE, Estimate, possible_moisture
from soilmoist_ros.pipeline import EarlierRun, MapRun, RunChange
from soilmoist_ros.reporting.page import numbers


@dataclass(frozen=True)
class EarlierRow:
    """A row of the table of earlier surveys.

    :param name: name of the survey
    :param date: its day; empty for a clock without a date
    :param records: number of records used
    :param samples: number of samples
    :param relation: correlation of its pattern with that of the present survey; empty if unknown
    :param change: change of the field's mean since then; empty if unknown
    :param remarks: what the user should know
    """

    name: str
    date: str
    records: int
    samples: int
    relation: str
    change: str
    remarks: str


@dataclass(frozen=True)
class EarlierPart:
    """The part of the report.

    :param text: sentences on what the surveys contributed
    :param change: sentences on what has changed; empty if it is not known
    :param rows: the earlier surveys in order of time
    """

    text: str
    change: str
    rows: tuple[EarlierRow, ...]


def earlier_part(run: MapRun) -> EarlierPart | None:
    """The part of the report on earlier surveys; ``None`` without any."""
    if not run.earlier:
        return None
    found, related = run.change, relations(run)
    rows = tuple(
        EarlierRow(
            one.survey.name,
            one.date or "no date",
            len(one.records),
            len(one.survey.samples),
            f"{related[one.survey.name]:.2f}" if one.survey.name in related else "",
            _since(run, one.survey.name),
            " ".join(one.remarks),
        )
        for one in run.earlier
    )
    if found is None:
        return EarlierPart("The counts of earlier surveys inform this map.", "", rows)
    return EarlierPart(contribution(found), change_text(found), rows)


def relations(run: MapRun) -> dict[str, float]:
    """Correlation of the pattern of each earlier survey with that of the present one, as the map has it."""
    fit = run.soil_map.fit
    if fit is None or fit.prior is None:
        return {}
    return {one.name: one.correlation for one in fit.prior.relations}


def contribution(found: RunChange) -> str:
    """What the earlier surveys contributed, in sentences."""
    share = 1 - found.sd / found.sd_alone if found.sd_alone > 0 else 0.0
    persistence = found.persistence
    fades = ""
    if persistence.decay_days < 1e6:
        fades = f" It falls to a third in {numbers.number(persistence.decay_days, 2)} days."
    gain = (
        f"They lower the standard deviation of the smooth rate from {numbers.number(found.sd_alone, 2)} to "
        f"{numbers.number(found.sd, 2)} counts/s, by {numbers.percent(share)}."
    )
    return (
        "The counts of earlier surveys inform this map. The patterns of two surveys of this field have a "
        f"correlation of {persistence.share:.2f} ± {persistence.sd:.2f}.{fades} {gain}"
    )


def change_text(found: RunChange) -> str:
    """What has changed since the latest earlier survey, in sentences."""
    drier, wetter = found.change.shares
    kind = "rate" if found.change.mean_vwc is None else "moisture"
    mean = found.change.mean_vwc or found.change.mean_rate
    low, high = mean.interval95
    seen = (
        f"the mean {kind} has changed by" if low > 0 or high < 0 else f"no change of the mean {kind} can be seen:"
    )
    amount = f"{seen} {change_amount(found)}"
    since = change_since(found)
    return (
        f"{since[:1].upper()}{since[1:]}, {amount}. {numbers.percent(wetter)} of the field has become wetter "
        f"and {numbers.percent(drier)} drier significantly: of the cells called changed, "
        f"{numbers.percent(FALSE_SHARE)} at most are expected not to be. The uncertainty is that of both surveys "
        "together."
    )


def change_summary(found: RunChange) -> str:
    """What has changed since the latest earlier survey, in one line."""
    drier, wetter = found.change.shares
    return (
        f"{change_since(found)}: mean {change_amount(found)}, "
        f"{100 * wetter:.0f} % of the field significantly wetter, {100 * drier:.0f} % drier"
    )


def change_amount(found: RunChange) -> str:
    """Change of the field's mean with its 95 % interval: of the moisture, or of the rate without a calibration."""
    mean = found.change.mean_vwc
    if mean is None:
        return _rate(found.change.mean_rate)
    value, low, high = (round(100 * value, 1) + 0.0 for value in (mean.value, *mean.interval95))
    return f"{value:+.1f} % by volume ({low:+.1f} to {high:+.1f})"


def change_since(found: RunChange) -> str:
    """What a change compares with."""
    return f"{'compared with the later survey' if found.backwards else 'since the survey'} {dated(found.since)}"


def dated(run: EarlierRun) -> str:
    """Name of an earlier survey, with its day if known."""
    return f"{run.survey.name}{f' of {run.date}' if run.date else ''}"


def _since(run: MapRun, name: str) -> str:
    """Change of the mean since a survey: of the rate, or of the moisture that the mean rate means."""
    change = None if run.change is None else run.change.means.get(name)
    curve = run.soil_map.curve
    if change is None or curve is None:
        return "" if change is None else _rate(change)
    if run.change is not None and run.change.since.survey.name == name:
        return f"{change_amount(run.change)} [{change.value:+.3f} counts/s]"
    now = float(np.nanmean(run.soil_map.rate))
    then = now - np.array([change.value, *change.interval95])
    value, high, low = (100 * (possible_moisture(curve, now) - possible_moisture(curve, then))).tolist()
    return f"{value:+.1f} % by volume ({low:+.1f} to {high:+.1f}) [{change.value:+.3f} counts/s]"


def _rate(change: Estimate) -> str:
    low, high = change.interval95
    return f"{change.value:+.3f} counts/s ({low:+.3f} to {high:+.3f})"
