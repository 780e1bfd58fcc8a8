"""A recorded run, mapped again at a desk."""

from __future__ import annotations

from typing import TYPE_CHECKING

from soilmoist_ros.foundation.lazy import load_on_use

if TYPE_CHECKING:
    from soilmoist_ros.replay.bag_map import Replay, ReplaySettings, replay_bag

__all__ = ["Replay", "ReplaySettings", "replay_bag"]

__getattr__ = load_on_use(__name__, __file__)
