"""Scenarios: what goes wrong in a simulated mission, as real navigation, loggers and receivers do."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from soilmoist_ros.foundation.configuration import Section, load_model, resource

Number = Annotated[int, Field(ge=1)]
Seconds = Annotated[float, Field(ge=0)]
Duration = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, le=1)]


class Span(Section):
    """A time during which something does not work."""

    at_s: Seconds
    """When it begins, in simulated time since the start [s]."""
    for_s: Duration
    """How long it lasts [s]."""

    def covers(self, now_s: float) -> bool:
        """Whether a time since the start lies in it."""
        return self.at_s <= now_s < self.at_s + self.for_s

    @property
    def ends(self) -> tuple[float, float]:
        """Begin and end, since the start [s]."""
        return self.at_s, self.at_s + self.for_s


class Occasion(Section):
    """The n-th of something, and perhaps every so-many-th after it."""

    nth: Number
    """The first one concerned, counted from 1."""
    every: Number | None = None
    """After it, each so-many-th as well; only that one if left out."""

    def hits(self, number: int) -> bool:
        """Whether the one of this number is concerned."""
        if number < self.nth:
            return False
        return number == self.nth if self.every is None else (number - self.nth) % self.every == 0


class GoalFault(Occasion):
    """A goal that does not end as it should."""

    kind: Literal["no_motion", "fails", "hangs"]
    """``no_motion``: success is reported at once, and the robot has not moved; ``fails``: aborted on the way;
    ``hangs``: the robot stands still, and the goal never ends."""
    share_of_way: Share = 0.5
    """For ``fails``: how much of the way has been driven."""


class NavigationFaults(Section):
    """How the navigation behaves; by default as it should."""

    localisation_delay_s: tuple[Seconds, Seconds] = (0.0, 0.0)
    """``closest_node`` and ``current_node`` are late by a random time between these two [s]."""
    cancel: Literal["accepted", "looks_rejected"] = "accepted"
    """``accepted``: the goal ends as cancelled; ``looks_rejected``: the answer names no goal, but the robot stops
    and the goal ends as aborted."""
    superseded: Literal["aborted", "success"] = "aborted"
    """How a goal ends that a new one replaces; ``success``: it reports success, wherever the robot is."""
    unknown_target: Literal["rejected", "aborted"] = "rejected"
    """What becomes of a goal for a node that does not exist; ``aborted``: it is accepted first."""
    feedback: Literal["action", "topic"] = "action"
    """Whether feedback comes with the action, or on the plain topic ``topological_navigation/feedback`` only."""
    goals: tuple[GoalFault, ...] = ()
    """Goals that do not end as they should, by their number."""
    failing_edges: tuple[tuple[str, str], ...] = ()
    """Edges [from, to] that cannot be driven: the robot stops where they begin, the goal is aborted."""
    absent: tuple[Span, ...] = ()
    """When there is no navigation server; a goal under way is lost without an answer, the robot stops."""

    @model_validator(mode="after")
    def _delays_in_order(self) -> NavigationFaults:
        if self.localisation_delay_s[0] > self.localisation_delay_s[1]:
            raise ValueError("'localisation_delay_s' is the shortest and the longest delay, in this order")
        return self


class Outage(Span):
    """A time during which a connection does not deliver."""

    kind: Literal["cut", "silence", "stall"]
    """``cut``: connections are closed and new ones refused; ``silence``: they stay open, but nothing comes, and
    what was to come is lost; ``stall``: what was to come is held back, and comes all at once."""


class Damage(Occasion):
    """A message (a record of the logger, an epoch of the receiver) that does not arrive as it should."""

    kind: Literal["missing", "twice", "wrong_checksum", "no_checksum", "cut_short", "split", "garbage"]
    """``missing``: it is lost; ``twice``: it comes twice; ``wrong_checksum``: one digit has changed;
    ``no_checksum``: it ends before the star; ``cut_short``: it breaks off, and the next follows without a line
    end; ``split``: its second half comes half a second later; ``garbage``: a line of random bytes precedes it."""


class LinkFaults(Section):
    """What happens to one connection."""

    outages: tuple[Outage, ...] = ()
    """Times during which it does not deliver."""
    damages: tuple[Damage, ...] = ()
    """Single messages that it spoils."""


class GnssFaults(LinkFaults):
    """What happens to the GNSS receiver and its connection."""

    no_fix: tuple[Span, ...] = ()
    """When the receiver does not know where it is."""


class Scenario(Section):
    """What goes wrong in a mission; nothing by default."""

    title: str = "nothing goes wrong"
    """Shown in the log."""
    navigation: NavigationFaults = NavigationFaults()
    """Behaviour of the navigation."""
    logger: LinkFaults = LinkFaults()
    """Faults of the connection to the neutron logger."""
    gnss: GnssFaults = GnssFaults()
    """Faults of the GNSS receiver and its connection."""


def load_scenario(name: str) -> Scenario:
    """A scenario by the name of a shipped file or by path; empty for a mission in which nothing goes wrong.

    :raises InputError: if there is no such file, or with every mistake in it
    """
    return load_model(resource("scenarios", name), Scenario) if name else Scenario()
