"""Health of the recorder for ``/diagnostics``."""

from __future__ import annotations

from soilmoist_ros.foundation.health import Health, Level
from soilmoist_ros.recording.bag.recorder import RecorderState


def recorder_health(
    state: RecorderState, free_bytes: int | None, low_disk_bytes: float, skipped: int = 0
) -> Health:
    """Health of the recorder.

    :param state: its state
    :param free_bytes: space left on its disk [bytes], ``None`` if unknown
    :param low_disk_bytes: free space below which the recorder warns [bytes]
    :param skipped: topics that are not recorded because their type is not installed
    """
    if state.problem:
        level, message = Level.ERROR, state.problem
    elif not state.recording:
        level, message = Level.WARN, "not recording"
    elif free_bytes is not None and free_bytes < low_disk_bytes:
        level, message = Level.WARN, f"only {free_bytes / 1e6:.0f} MB left on the disk"
    elif state.dropped:
        level, message = Level.WARN, f"{state.dropped} messages lost: the disk is too slow"
    else:
        level, message = Level.OK, "recording"
    values = {
        "bag": str(state.bag or ""),
        "messages": str(state.messages),
        "dropped": str(state.dropped),
        "topics": str(state.topics),
        "topics skipped": str(skipped),
        "size [MB]": f"{state.size_bytes / 1e6:.3f}",
        "waiting [MB]": f"{state.waiting_bytes / 1e6:.3f}",
        "disk free [MB]": "unknown" if free_bytes is None else f"{free_bytes / 1e6:.0f}",
    }
    return Health("bag", level, message, values)
