# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lines on a map that several commands print."""

from __future__ import annotations

from typing import TYPE_CHECKING

from soilmoist_ros.cli.answers.answer import say, warn

if TYPE_CHECKING:
    from soilmoist_ros.pipeline import MapRun

MAX_REASONS = 3
"""Number of reasons for lost records that are printed."""


def rate_error(mse: float, coverage95: float) -> str:
    """Error of a rate map: mean squared error [(counts/s)^2] and share of the cells within their interval."""
    return f"MSE {mse:.4f} (counts/s)2, {100 * coverage95:.0f} % of the cells within their 95 % interval"


def print_knowledge(run: MapRun) -> None:
    """Print what a reference sensor, earlier surveys and covariates contributed to a map, and what has changed."""
    from soilmoist_ros.pipeline import REFERENCE
    from soilmoist_ros.reporting import change_amount, change_since, covariate_importance, dated, relations

    for row in run.corrections:
        if row.name == REFERENCE:
            say(f"reference  {', '.join(f'{name} {value}' for name, value in row.parameters.items())}")
    related = relations(run)
    for one in run.earlier:
        known = related.get(one.survey.name)
        relation = "" if known is None else f", correlation of the patterns {known:.2f}"
        remarks = "".join(f". {remark.rstrip('.')}" for remark in one.remarks)
        say(f"earlier    {dated(one)}: {len(one.survey.samples)} samples{relation}{remarks}")
    found = run.change
    if found is not None:
        share = 1 - found.sd / found.sd_alone if found.sd_alone > 0 else 0.0
        drier, wetter = found.change.shares
        say(f"           the standard deviation of the smooth rate is {100 * share:.0f} % lower with them")
        say(f"change     {change_since(found)}: mean {change_amount(found)}")
        say(f"           {100 * wetter:.0f} % of the field significantly wetter, {100 * drier:.0f} % drier")
    for part in covariate_importance(run):
        effect, share95 = part.rate_cps, part.variance_share
        say(
            f"covariate  {part.name}: {effect.value:+.3f} counts/s per standard deviation "
            f"({effect.p025:+.3f} to {effect.p975:+.3f}), {100 * share95.value:.0f} % of the variance"
        )


def print_losses(run: MapRun) -> None:
    """Print why records were lost, the most frequent reasons first."""
    for row in [row for row in run.losses if row.consequence == "lost"][:MAX_REASONS]:
        remedy = f" -> {row.remedy}" if row.remedy else ""
        warn(f"lost       {row.count} by {row.kind}, such as {row.example}{remedy}")


def print_notes(run: MapRun) -> None:
    """Print the notes on a map."""
    from soilmoist_ros.reporting import notes

    for note in notes(run):
        warn(f"warning    {note}")
