# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tests by fixed rules whether a campaign confirms the findings of the published experiments."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.lab.campaign_data import CampaignData
from soilmoist_ros.lab.campaign_file import FindingKey
from soilmoist_ros.reporting import dwell_text, percent, strategy_text

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
Outcome = Literal["seen", "partly", "not seen", "too few runs"]
Verdict = Literal["confirmed", "partly", "not seen", "not tested"]
Reasons = Mapping[FindingKey, str]

MIN_RUNS = 3
LITTLE = 0.20  # largest difference that counts as little, as a share of the mean squared error
FAR_LESS = 0.25  # smallest saving that counts as far less driving, as a share of the distance
SLIGHTLY = 0.50  # largest increase that counts as slightly higher, as a share of the error


@dataclass(frozen=True)
class Comparison:
    """A measured difference, paired by seed."""

    where: str  # field
    what: str  # the two sets of missions
    quantity: str  # measure with its unit
    value: float  # mean over the runs of the first set
    reference: float  # mean over the runs of the second set
    difference: float  # mean of the paired differences, value minus reference
    standard_error: float  # standard error of the difference; NaN with fewer than two pairs
    pairs: int  # number of seeds in both sets
    outcome: Outcome  # whether the difference supports the finding

    @property
    def relative(self) -> float:
        """Difference as a share of the reference."""
        return self.difference / self.reference if self.reference else float("nan")


@dataclass(frozen=True)
class CampaignFinding:
    """A published finding and the verdict of the campaign."""

    key: FindingKey  # short name
    statement: str  # the finding
    rule: str  # condition for the verdict ``confirmed``
    verdict: Verdict
    summary: str  # the measured numbers in a sentence
    comparisons: tuple[Comparison, ...]
    reason: str  # why the finding is not confirmed, from the campaign's file; may be empty


def findings(data: CampaignData) -> list[CampaignFinding]:
    """The published findings with verdicts; none if the campaign names no published results."""
    published = data.campaign.published
    if published is None:
        return []
    reasons = published.reasons
    return [
        _finding(
            "ami_high",
            "On a field with a high moisture gradient, the map converges faster with adaptive counting intervals "
            "(AMI) than with fixed ones (FMI).",
            "Measure: mean squared error, averaged over the times at which both missions have a map, and over the "
            "strategies. Seen where it is lower with AMI by more than two standard errors.",
            list(_intervals(data, published.high_gradient or (), _lower)),
            reasons,
        ),
        _finding(
            "ami_low",
            "On a field with a low moisture gradient there is little difference between the two.",
            f"Same measure. Seen where the difference and two standard errors together stay within "
            f"{percent(LITTLE)} of the error with FMI; partly where only the difference itself does.",
            list(_intervals(data, published.low_gradient or (), _alike)),
            reasons,
        ),
        _adaptive_sampling(data, reasons),
        _finding(
            "greedy_border",
            "The greedy strategy keeps to the border of the field.",
            "Measure: share of the stops in the strip along the border that holds half of the area. Seen where it "
            "is above one half, and above that of Monte Carlo, by more than two standard errors.",
            list(_border(data)),
            reasons,
        ),
    ]


def _finding(
    key: FindingKey, statement: str, rule: str, comparisons: Sequence[Comparison], reasons: Reasons,
    needed: Sequence[Comparison] = (),
) -> CampaignFinding:  # fmt: skip
    """A finding: confirmed if all comparisons support it, not seen if none of the needed ones does."""
    judged = [item for item in comparisons if item.outcome != "too few runs"]
    crucial = [item for item in needed or judged if item.outcome != "too few runs"]
    verdict: Verdict
    if not judged:
        verdict = "not tested"
    elif all(item.outcome == "seen" for item in judged):
        verdict = "confirmed"
    elif all(item.outcome == "not seen" for item in crucial):
        verdict = "not seen"
    else:
        verdict = "partly"
    if judged:
        summary = f"Seen {_shares(judged)}."
    elif comparisons:
        summary = f"Fewer than {MIN_RUNS} pairs of runs: nothing can be said."
    else:
        summary = "The campaign has no missions that test this."
    reason = reasons.get(key, "") if verdict in ("partly", "not seen") else ""
    return CampaignFinding(key, statement, rule, verdict, summary, tuple(comparisons), reason)


def _shares(comparisons: Sequence[Comparison]) -> str:
    """For each quantity: number of comparisons with outcome ``seen``, smallest and largest difference."""
    texts = []
    for quantity in dict.fromkeys(item.quantity for item in comparisons):
        mine = [item for item in comparisons if item.quantity == quantity]
        seen = sum(item.outcome == "seen" for item in mine)
        shares = [100 * item.relative for item in mine]
        low, high = (f"{value:+.0f}".replace("-", "−") for value in (min(shares), max(shares)))
        texts.append(
            f"in {seen} of {len(mine)} comparison{'s' if len(mine) != 1 else ''} of the "
            f"{quantity.partition(' [')[0]} ({low if low == high else f'{low} to {high}'} %)"
        )
    return " and ".join(texts)


def _adaptive_sampling(data: CampaignData, reasons: Reasons) -> CampaignFinding:
    distances: list[Comparison] = []
    errors: list[Comparison] = []
    for case in data.strategy_cases:
        final = data.final(case)
        mine = final[final["strategy"] == "adaptive_sampling"].set_index("seed")
        for other in ("greedy", "monte_carlo"):
            theirs = final[final["strategy"] == other].set_index("seed")
            what = f"{strategy_text('adaptive_sampling')} against {strategy_text(other)}"
            for rows, name, quantity, judge in (
                (distances, "distance_m", "distance driven [m]", _far_less),
                (errors, "mse", "final mean squared error [(counts/s)²]", _slightly_more),
            ):
                if len(mine) and len(theirs):
                    rows.append(_compared(case.title, what, quantity, mine[name], theirs[name], judge))
    return _finding(
        "adaptive_sampling",
        "Adaptive sampling drives far less than the other strategies, for a slightly higher error.",
        f"Seen where the distance is at least {percent(FAR_LESS)} shorter, and shorter by more than two standard "
        f"errors; and where the final error is at most {percent(SLIGHTLY)} higher. Partly where the error is "
        "lower instead, by more than two standard errors. Not seen if no distance is that much shorter.",
        [row for pair in zip(distances, errors, strict=True) for row in pair],
        reasons,
        needed=distances,
    )


def _intervals(data: CampaignData, fields: Sequence[str], judge: _Judge) -> Iterator[Comparison]:
    """Compare adaptive with fixed intervals: the longest with the longest, and so on."""
    quantity = "error averaged over time [(counts/s)²]"
    for case in data.cases:
        if case.field not in fields:
            continue
        rows = data.over_time(case)
        dwells = list(rows["dwell"].unique())
        fixed = sorted((d for d in dwells if d.startswith("fmi")), key=lambda d: -float(d[4:]))
        adaptive = sorted((d for d in dwells if d.startswith("ami")), key=lambda d: float(d[4:]))
        for ami, fmi in zip(adaptive, fixed, strict=False):
            mine, theirs = paired_means(rows[rows["dwell"] == ami], rows[rows["dwell"] == fmi])
            if len(mine):
                what = f"{dwell_text(ami)} against {dwell_text(fmi)}"
                yield _compared(case.title, what, quantity, mine, theirs, judge)


def paired_means(mine: pd.DataFrame, theirs: pd.DataFrame) -> tuple[pd.Series, pd.Series]:
    """Errors of two sets of missions, averaged over their common times and strategies; one value per seed."""
    columns = ["seed", "strategy", "time_s"]
    both = mine.merge(theirs, on=columns, suffixes=("", "_theirs")).dropna(subset=["mse", "mse_theirs"])
    means = both.groupby(["seed", "strategy"])[["mse", "mse_theirs"]].mean().groupby("seed").mean()
    return means["mse"], means["mse_theirs"]


def _border(data: CampaignData) -> Iterator[Comparison]:
    quantity = "share of stops in the outer half"
    for case in data.strategy_cases:
        final = data.final(case)
        greedy, other = (
            final[final["strategy"] == name].set_index("seed")["border_share"]
            for name in ("greedy", "monte_carlo")
        )
        if len(greedy):
            half = greedy * 0 + 0.5
            yield _compared(case.title, "Greedy against stops anywhere", quantity, greedy, half, _higher)
        if len(greedy) and len(other):
            yield _compared(case.title, "Greedy against Monte Carlo", quantity, greedy, other, _higher)


_Judge = Callable[[float, float, float], Outcome]  # outcome of (difference, standard error, reference)


def _compared(
    where: str, what: str, quantity: str, mine: pd.Series, theirs: pd.Series, judge: _Judge
) -> Comparison:
    """Compare two series that are indexed by seed."""
    pairs = mine.to_frame("mine").join(theirs.to_frame("theirs"), how="inner").dropna()
    a, b = pairs["mine"].to_numpy(float), pairs["theirs"].to_numpy(float)
    n = len(pairs)
    difference = float((a - b).mean()) if n else float("nan")
    error = float((a - b).std(ddof=1) / np.sqrt(n)) if n > 1 else float("nan")
    value, reference = (float(x.mean()) if n else float("nan") for x in (a, b))
    outcome: Outcome = judge(difference, error, reference) if n >= MIN_RUNS else "too few runs"
    return Comparison(where, what, quantity, value, reference, difference, error, n, outcome)


def _lower(difference: float, error: float, _reference: float) -> Outcome:
    return "seen" if difference < -2 * error else "not seen"


def _higher(difference: float, error: float, _reference: float) -> Outcome:
    return "seen" if difference > 2 * error else "not seen"


def _alike(difference: float, error: float, reference: float) -> Outcome:
    if abs(difference) + 2 * error <= LITTLE * reference:
        return "seen"
    return "partly" if abs(difference) <= LITTLE * reference else "not seen"


def _far_less(difference: float, error: float, reference: float) -> Outcome:
    return "seen" if difference < -2 * error and difference <= -FAR_LESS * reference else "not seen"


def _slightly_more(difference: float, error: float, reference: float) -> Outcome:
    if difference < -2 * error:
        return "partly"
    return "seen" if difference <= SLIGHTLY * reference else "not seen"
