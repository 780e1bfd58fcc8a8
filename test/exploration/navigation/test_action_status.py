# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Whose goals the servers of an action list."""

import pytest

from soilmoist_ros.exploration.navigation.goal_client import ActionStatus

ONE, TWO = b"one", b"two"


def test_own_goals_those_of_an_earlier_life_and_those_of_others():
    before, status = ActionStatus("/planner"), ActionStatus("/planner")
    own, again, old, other = status.new_identity(), status.new_identity(), before.new_identity(), bytes(range(16))
    assert len({own, again, old}) == 3
    assert [len(each) for each in (own, again, old)] == [16, 16, 16]
    assert not ActionStatus("/planner_2").new_identity().startswith(own[:8])
    status.serve(frozenset([ONE]))
    status.take({own: 2, again: 4, old: 1, other: 3})
    assert (status.before, status.others, status.state(again)) == ((old,), (other,), 4)
    status.take({own: 2, old: 6, other: 5})
    assert (status.before, status.others, status.state(again)) == ((), (), 0), "what has ended drives nobody"


@pytest.mark.parametrize("next_servers", [[], [TWO]])
def test_what_a_server_that_has_died_listed_does_not_count(next_servers):
    status = ActionStatus("/planner")
    assert not status.serve(frozenset([ONE]))
    status.take({bytes(16): 2})
    assert status.known
    anew = status.serve(frozenset(next_servers))
    assert (status.others, status.known, anew) == ((), False, bool(next_servers))


def test_each_of_two_servers_has_a_list():
    status = ActionStatus("/planner")
    status.serve(frozenset([ONE, TWO]))
    status.take({b"a" * 16: 2})
    status.take({b"b" * 16: 2})
    assert len(status.others) == 2
    assert status.serve(frozenset([TWO])), "its list is fetched again"
    assert status.others == ()
