# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What runs in each worker of a Dask cluster when it joins a campaign. Needs Dask."""

from __future__ import annotations

import logging
from typing import Any, Final

from distributed import WorkerPlugin

from soilmoist_ros.simulation.campaign.computing import Simulate
from soilmoist_ros.simulation.campaign.mission_store import code_version

NAME: Final = "soilmoist_ros-campaign"
SAMPLING: Final = ("profile", "profile-cycle")
"""What Dask calls 100 times a second to see where its tasks are, which takes some of the worker's time."""
_log = logging.getLogger("distributed.worker")  # which Dask shows in the terminal of the worker


class Gate(WorkerPlugin):
    """Close a worker with another version of this package; load the simulator in all others.

    During the campaign, Dask does not profile the worker, whose missions would take longer.

    :param version: version of the campaign
    :param simulate: simulates one mission; reading this plugin loads its module
    """

    def __init__(self, version: str, simulate: Simulate) -> None:
        self._version = version
        self._simulate = simulate

    def setup(self, worker: Any) -> None:
        """Check the version of a worker that joins."""
        if code_version() == self._version:
            self._sample(worker, False)
            return
        reason = f"this worker has soilmoist_ros {code_version()}, the campaign {self._version}"
        _log.error("%s; install the same version", reason)
        worker.loop.add_callback(worker.close, reason=reason)

    def teardown(self, worker: Any) -> None:
        """Let Dask profile the worker again."""
        self._sample(worker, True)

    def _sample(self, worker: Any, wanted: bool) -> None:
        for name in SAMPLING:
            if (callback := worker.periodic_callbacks.get(name)) is not None:
                worker.loop.add_callback(callback.start if wanted else callback.stop)
