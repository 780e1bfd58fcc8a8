# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chisquare

from soilmoist_ros.exploration import (
    STRATEGIES,
    Choice,
    FreeTravel,
    RobotMotion,
    Situation,
    Stop,
    StrategyKind,
    make_strategy,
    warm_up,
)
from soilmoist_ros.exploration.strategies.route import timed_route
from soilmoist_ros.exploration.strategies.strategy import PRESETS, AdaptiveSampling, Preset, weighted_order
from soilmoist_ros.foundation.errors import InputError

X, Y = (axis.ravel() for axis in np.meshgrid(np.arange(12) * 5.0, np.arange(10) * 5.0))
PLACES = np.column_stack([X, Y])
HILLS = 0.1 + 0.05 * np.sin(X / 9) * np.cos(Y / 7)


def situation(
    variance=HILLS,
    places=PLACES,
    measured=(),
    left=7200.0,
    dwell=300.0,
    position=(0.0, 0.0),
    travel=None,
    names=None,
):
    places = np.asarray(places, float)
    names = names or [f"p{i}" for i in range(len(places))]
    stops = tuple(Stop(name, float(x), float(y)) for name, (x, y) in zip(names, places, strict=True))
    model = FreeTravel(RobotMotion())
    return Situation(
        candidates=stops, candidates_xy=places, stop_variance=lambda: np.asarray(variance, float),
        map_variance=np.asarray(variance if len(variance) == len(PLACES) else HILLS, float), map_xy=PLACES,
        cell_m=5.0, position_xy=np.asarray(position, float),
        measured_xy=np.asarray(measured, float).reshape(-1, 2),
        travel_s=model.travel_s(position, stops) if travel is None else np.asarray(travel, float),
        travel_between_s=lambda indices: model.between_s(stops, indices), time_left_s=left, expected_dwell_s=dwell,
    )  # fmt: skip


def rng(seed=0):
    return np.random.default_rng(seed)


def after(now, **changes):
    return Situation(**{**{name: getattr(now, name) for name in Situation.__dataclass_fields__}, **changes})


every = pytest.mark.parametrize("name", STRATEGIES.names())
both = pytest.mark.parametrize("preset", list(PRESETS))


def test_the_presets_are_the_published_constants():
    assert PRESETS["paper"] == Preset("paper", 3, 0.0, 0.0, 0.0, None)
    assert PRESETS["authors"] == Preset("authors", 3, 4.0, 0.9, 0.5, 5.0)
    without = [name for name in STRATEGIES.names() if not STRATEGIES.get(name).needs_map]
    assert without == ["random", "lattice", "two_pass"]
    some_cells = {name for name in STRATEGIES.names() if not STRATEGIES.get(name).whole_map}
    assert some_cells == {*without, "gcb"}


@pytest.mark.parametrize(
    ("given", "preset", "said"),
    [
        (StrategyKind(lambda preset: 1, "mine"), "paper", "must return an object with a method choose; it .* int"),
        ("gredy", "paper", "'gredy' -> use one of: greedy, .*did you mean 'greedy'"),
        ("greedy", "author", r"'author' -> use one of: recommended, paper, authors \(did you mean 'authors'"),
    ],
)
def test_others_are_refused_with_what_is_known(given, preset, said):
    with pytest.raises(InputError, match=said):
        make_strategy(given, preset)


class First:
    """Chooses the first candidate, and counts its choices."""

    choices = 0

    def choose(self, situation, rng):
        self.choices += 1
        return Choice(situation.candidates[0], "the first")


@pytest.mark.parametrize("given", [First, First(), StrategyKind(lambda preset: First())])
def test_a_class_an_object_and_a_kind_are_strategies_and_each_mission_has_its_own(given):
    one, two = make_strategy(given), make_strategy(given)
    one.choose(situation(), rng())
    assert (one.choices, two.choices, warm_up(given, "authors")[0]) == (1, 0, 3)


@every
@both
def test_what_cannot_be_reached_in_time_is_never_chosen(name, preset):
    travel = np.full(len(PLACES), np.inf)
    travel[[7, 40, 90]] = 100.0, 250.0, 300.0
    allowed = {"p7", "p40"}
    for seed in range(5):
        choice = make_strategy(name, preset).choose(situation(travel=travel, left=300.0), rng(seed))
        assert choice.stop.name in allowed
        assert {stop.name for stop in choice.ahead} <= allowed
    assert make_strategy(name, preset).choose(situation(travel=travel, left=100.0), rng()) is None
    assert make_strategy(name, preset).choose(situation(np.empty(0), np.empty((0, 2)), travel=[]), rng()) is None


@pytest.mark.slow
@every
@both
def test_the_same_seed_gives_the_same_mission(name, preset):
    missions = []
    for _ in range(2):
        strategy, dice, chosen, now = make_strategy(name, preset), rng(3), [], situation()
        for step in range(6):
            choice = strategy.choose(now, dice)
            chosen.append((choice.stop.name, choice.reason, choice.ahead))
            place = (choice.stop.x_m, choice.stop.y_m)
            now = situation(HILLS * (1 - 0.1 * step), position=place, measured=[place], left=7200 - 400 * step)
        missions.append(chosen)
    assert missions[0] == missions[1]


@every
def test_new_targets_of_the_authors_keep_four_cells_away(name):
    if name in ("lattice", "two_pass", "gcb"):
        return  # not among the authors': lattices look at no map, gcb knows what counting again is worth
    measured = [[10.0, 10.0], [40.0, 30.0]]
    for seed in range(10):
        choice = make_strategy(name, "authors").choose(situation(measured=measured), rng(seed))
        for stop in (choice.stop, *choice.ahead):
            assert min(np.hypot(stop.x_m - x, stop.y_m - y) for x, y in measured) >= 20 - 1e-6
    everywhere = situation(measured=PLACES)
    assert make_strategy(name, "authors").choose(everywhere, rng()) is None
    assert make_strategy(name, "paper").choose(everywhere, rng()) is not None


@pytest.mark.slow
@settings(deadline=None, max_examples=50)
@given(st.lists(st.integers(0, 5), min_size=120, max_size=120))
def test_greedy_takes_the_first_of_the_highest(values):
    variance = np.array(values, float)
    choice = make_strategy("greedy").choose(situation(variance), rng())
    assert choice.stop.name == f"p{np.argmax(variance)}"
    assert choice.ahead == ()


@pytest.mark.slow
@pytest.mark.parametrize(("preset", "floor"), [("paper", 0.0), ("authors", 0.45)])
def test_monte_carlo_draws_in_proportion_to_the_variance_above_the_floor(preset, floor):
    variance, dice = np.linspace(0, 1, 120), rng(11)
    strategy, now = make_strategy("monte_carlo", preset), situation(variance)
    drawn = [int(strategy.choose(now, dice).stop.name[1:]) for _ in range(4000)]
    count, high = np.bincount(drawn, minlength=120), variance > floor
    assert count[~high].sum() == 0
    assert chisquare(count[high], 4000 * variance[high] / variance[high].sum()).pvalue > 0.01


def test_monte_carlo_goes_on_when_no_candidate_is_above_the_floor():
    now = after(situation(np.full(120, 0.01)), map_variance=np.full(120, 1.0))
    choice = make_strategy("monte_carlo", "authors").choose(now, rng())
    assert "among 120 candidates, none above 0.9 times the mean" in choice.reason


def test_draws_without_replacement_follow_the_weights():
    weight, dice = np.array([1.0, 2.0, 0.0, 5.0]), rng(2)
    orders = np.array([weighted_order(weight, dice) for _ in range(4000)])
    assert (orders[:, 3] == 2).all()
    second = orders[orders[:, 0] == 3, 1]
    assert chisquare(np.bincount(second)[:2], len(second) * np.array([1, 2]) / 3).pvalue > 0.01
    assert sorted(weighted_order(np.zeros(3), dice)) == [0, 1, 2]


def tour_s(now, choice):
    """Time that a plan takes, dwell included."""
    number = {stop.name: index for index, stop in enumerate(now.candidates)}
    order = np.array([number[stop.name] for stop in (choice.stop, *choice.ahead)])
    between = now.travel_between_s(order)
    return timed_route(np.arange(len(order)), now.travel_s[order], between, now.expected_dwell_s).duration_s


@pytest.mark.parametrize("left", [400.0, 7200.0])
def test_the_papers_queue_fills_the_time_left(left):
    for seed in range(3):
        now = situation(left=left)
        choice = make_strategy("adaptive_sampling").choose(now, rng(seed))
        used = tour_s(now, choice)
        assert used <= left or not choice.ahead
        longest = now.expected_dwell_s + now.travel_s.max() + now.travel_s.max()
        assert used > left - longest
        assert len({choice.stop, *choice.ahead}) == 1 + len(choice.ahead)


@pytest.mark.parametrize(("left", "size"), [(7200.0, 10), (2000.0, 2), (600.0, 1)])
def test_the_authors_queue_holds_five_samples_per_hour(left, size):
    choice = make_strategy("adaptive_sampling", "authors").choose(situation(left=left), rng())
    assert 1 + len(choice.ahead) == size
    assert choice.reason.startswith(f"first of {size} targets" if size > 1 else "the only target planned:")


@both
def test_adaptive_sampling_drops_exactly_the_targets_below_the_threshold(preset):
    strategy = AdaptiveSampling(PRESETS[preset])
    now = situation()
    strategy.choose(now, rng())
    queued = {stop.name for stop in strategy.queue}
    variance = HILLS.copy()
    low = sorted(queued)[::2]
    below = HILLS.mean() - PRESETS[preset].drop_below_sd * HILLS.std()
    for stop in strategy.queue:
        variance[int(stop.name[1:])] = below + (-1e-6 if stop.name in low else 1e-6)
    # nothing new can be drawn: all other candidates are out of reach, so that what is left was kept
    travel = np.where([f"p{i}" in queued for i in range(120)], now.travel_s, np.inf)
    later = after(now, stop_variance=lambda: variance, map_variance=HILLS, travel_s=travel, measured_xy=PLACES)
    strategy.preset = Preset(
        "strict", 3, 1000.0, 0.9, PRESETS[preset].drop_below_sd, PRESETS[preset].samples_per_hour
    )
    choice = strategy.choose(later, rng())
    assert {choice.stop.name, *(stop.name for stop in choice.ahead)} == queued - set(low)
    assert f"; {len(low)} below" in choice.reason


def test_queued_targets_that_are_ruled_out_or_out_of_reach_leave_the_queue():
    strategy = AdaptiveSampling(PRESETS["authors"])
    first = strategy.choose(situation(), rng())
    gone, lost = first.ahead[0].name, first.ahead[1].name
    keep = np.array([f"p{i}" != gone for i in range(120)])
    now = situation(HILLS[keep], PLACES[keep], names=[f"p{i}" for i in range(120) if keep[i]])
    travel = now.travel_s.copy()
    travel[[stop.name for stop in now.candidates].index(lost)] = np.inf
    second = strategy.choose(after(now, travel_s=travel), rng(1))
    assert not {gone, lost} & {second.stop.name, *(stop.name for stop in second.ahead)}
