"""A recorded run, mapped again at a desk."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from soilmoist_ros.replay.bag_map import Replay, ReplaySettings, replay_bag

__all__ = ["Replay", "ReplaySettings", "replay_bag"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(name)
    from soilmoist_ros.replay import bag_map

    return getattr(bag_map, name)
