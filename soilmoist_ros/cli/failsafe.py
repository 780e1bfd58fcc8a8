# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soilmoist failsafe``: what the guard does about a cause of danger in each phase of a mission."""

from __future__ import annotations

import click

from soilmoist_ros.cli.answer import answering, put, say

# As a list of names: to import them takes as long as the rest of the command.
PHASES = ["idle", "planning", "waiting", "travelling", "counting", "paused", "cancelling", "returning", "finished"]
RESPONSES = ["ignore", "warn", "pause", "hold", "return_home", "abort"]


@click.command("failsafe")
@click.argument("causes", nargs=-1, metavar="[CAUSE]...")
@click.option("--phase", type=click.Choice(PHASES), help="Phase of the mission. Default: all.")
@click.option("--response", type=click.Choice(RESPONSES),
              help="As if the planner had failsafes: [CAUSE:RESPONSE].")  # fmt: skip
@answering
def command(causes: tuple[str, ...], phase: str | None, response: str | None) -> None:
    """Show what the guard does about a CAUSE, and why: in each phase of a mission.

    The alarm is given to a small mission, which decides as the robot's does. Without a CAUSE, all are listed.
    """
    from soilmoist_ros.exploration import (
        FAILSAFES,
        LIMITS,
        Phase,
        Response,
        WatchLimits,
        chosen_response,
        consequence,
        find_cause,
    )

    known, limits = [find_cause(name) for name in causes], WatchLimits()
    found = []
    for cause in known or FAILSAFES:
        row = FAILSAFES[cause]
        answer = Response(response) if response else row.response
        answer = chosen_response(cause, answer) if known or answer in row.choices else row.response
        of = {name: getattr(limits, name) for name in row.limits if name in LIMITS}
        phases = [Phase(phase)] if phase else list(Phase) if known else []
        does = {one.value: consequence(answer, one, cause, cause.replace("_", " ")) for one in phases}
        item = {"cause": cause.value, "response": answer.value, "alarm": row.about, "remedy": row.remedy}
        shown = {name: {"does": one, "says": says} for name, (one, says) in does.items()}
        found.append({**item, "default": row.response.value, "limits": of, "phases": shown})
        if not known:
            say(f"{cause:17} {answer:11} {does[phase][0] if phase else row.about}")
            continue
        say(f"{cause}: {answer}{f' instead of {row.response}' if answer is not row.response else ''}")
        say(f"  alarm when   {row.about}")
        for name, value in of.items():
            say(f"  limit        {name} {f'{value:g} {LIMITS[name][0]}'.strip() if value else 'not set'}")
        say(f"  operator     {row.remedy}")
        for name, (one, says) in does.items():
            say(f"  {name:12} {one}{f': {says!r}' if says else ''}")
    put(failsafes=found)
    if not known:
        say("")
        say("soilmoist failsafe CAUSE says what the mission does in each phase.")
