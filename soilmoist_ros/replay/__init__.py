"""A recorded run, mapped again at a desk."""

import os

# As in the nodes, and before numpy is imported: with more threads the last digits of the map are others.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from soilmoist_ros.replay.bag_map import Replay, ReplaySettings, replay_bag

__all__ = ["Replay", "ReplaySettings", "replay_bag"]
