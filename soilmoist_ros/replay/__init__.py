"""A recorded run, mapped again at a desk."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

# As in the nodes, and before numpy is imported: with more threads the last digits of the map are others.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

if TYPE_CHECKING:
    from soilmoist_ros.replay.bag_map import Replay, ReplaySettings, replay_bag

__all__ = ["Replay", "ReplaySettings", "replay_bag"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(name)
    from soilmoist_ros.replay import bag_map

    return getattr(bag_map, name)
