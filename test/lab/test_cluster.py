# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Campaigns on a Dask cluster of real processes: cluster.py."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from copy import deepcopy
from pathlib import Path
from types import SimpleNamespace

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.lab import cluster
from soilmoist_ros.lab.campaign import CampaignStoppedError, run_campaign
from soilmoist_ros.lab.campaign_file import load_campaign

pytest.importorskip("distributed")
HERE = Path(__file__).resolve().parents[1] / "simulation"
LIMIT_S = 60.0
SLOW = """
import os, sys, time
from pathlib import Path
import fake_mission

def simulate(settings, progress=None):
    time.sleep(0.05)
    return fake_mission.simulate(settings, progress, 5.0)

def deadly(settings, progress=None):
    mark = Path(os.environ["MARK"])
    if settings.seed == 89 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), 9)
    return simulate(settings, progress)

if __name__ == "__main__":
    import slow
    from soilmoist_ros.lab import load_campaign, run_campaign
    run_campaign(load_campaign(sys.argv[1]), Path(sys.argv[2]), slow.simulate, scheduler=sys.argv[3])
"""

OTHER_VERSION = """
from soilmoist_ros.lab import mission_store
mission_store.code_version = lambda: "9.9"
from distributed.cli.dask_worker import main
main()
"""


@pytest.fixture(scope="module")
def tools(tmp_path_factory):
    """A folder with the simulator of these tests; processes and this one import it."""
    folder = tmp_path_factory.mktemp("tools")
    (folder / "slow.py").write_text(SLOW)
    return folder


@pytest.fixture
def slow(tools, monkeypatch):
    for path in (HERE, tools):
        monkeypatch.syspath_prepend(str(path))
    import slow

    return slow


@pytest.fixture
def started(tools):
    """Starts Dask's programs on ports that nobody else takes; what still runs is killed at the end."""
    running, held = [], []
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(tools), str(HERE), os.environ.get("PYTHONPATH", "")]),
        "MARK": str(tools / "died"),
        "DASK_DISTRIBUTED__WORKER__MEMORY__TERMINATE": "False",
    }

    def start(*command):
        process = subprocess.Popen(
            [sys.executable, *map(str, command)], env=environment, start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        running.append(process)
        return process

    def port():
        """A port that is held, so that it is given to none but a program that asks for it as Dask does."""
        held.append(socket.socket())
        held[-1].setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        held[-1].bind(("127.0.0.1", 0))
        return held[-1].getsockname()[1]

    start.environment, start.port = environment, port
    yield start
    for one in held:
        one.close()
    for process in running:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@pytest.fixture
def address(started):
    port = started.port()
    scheduler = started(
        "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"
    )
    address = f"tcp://127.0.0.1:{port}"
    started("-m", "distributed.cli.dask_worker", address, "--nthreads", 1, "--no-dashboard")
    wait_until(lambda: answers(address))
    return SimpleNamespace(text=address, scheduler=scheduler)


def answers(address):
    try:
        with cluster.connect(address, 5.0):
            return True
    except InputError:
        return False


def wait_until(condition):
    deadline = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def written(folder, runs):
    path = folder / "c.yaml"
    path.write_text(f"title: t\nruns: {runs}\nexperiments: [{{name: a, hours: 1, strategy: greedy}}]\n")
    return path


def stored(out):
    return {path.name: path.read_bytes() for path in out.glob("runs/*.npz")}


@pytest.mark.process
@pytest.mark.slow
def test_deaths_of_worker_and_client_change_nothing(tmp_path, slow, started, address):
    plan = written(tmp_path, 90)
    campaign = load_campaign(str(plan))
    run_campaign(campaign, tmp_path / "here", slow.simulate, workers=0)
    client = started(slow.__file__, plan, tmp_path / "there", address.text)
    wait_until(lambda: len(stored(tmp_path / "there")) > 3)
    client.kill()
    client.wait()
    before = stored(tmp_path / "there")
    states = []
    outcome = run_campaign(
        campaign, tmp_path / "there", slow.deadly, scheduler=address.text, progress=states.append
    )
    assert (Path(slow.__file__).parent / "died").exists(), "the worker was to die"
    assert outcome.complete
    assert outcome.reused == len(before) < 90
    assert [state.done for state in states if not state.note] == list(range(len(before), 91))
    assert stored(tmp_path / "there") == stored(tmp_path / "here")


@pytest.mark.process
@pytest.mark.slow
def test_a_campaign_without_scheduler_stops_and_says_how_to_resume(tmp_path, slow, address):
    campaign = load_campaign(str(written(tmp_path, 200)))

    def kill(state):
        if state.done == 3:
            address.scheduler.kill()

    with pytest.raises(CampaignStoppedError, match=r"does not answer any more: \d+ of 200 missions are stored"):
        run_campaign(campaign, tmp_path, slow.simulate, scheduler=address.text, progress=kill)
    assert len(stored(tmp_path)) >= 3


@pytest.mark.process
@pytest.mark.slow
def test_workers_of_another_version_are_refused(tmp_path, slow, started, address):
    campaign = load_campaign(str(written(tmp_path, 30)))
    late = []

    def start_another(state):
        if state.done == 3 and not late:
            late.append(started("-c", OTHER_VERSION, address.text, "--no-nanny", "--no-dashboard"))
            with cluster.connect(address.text) as client:
                wait_until(lambda: len(client.nthreads()) == 2)

    outcome = run_campaign(campaign, tmp_path / "a", slow.simulate, scheduler=address.text, progress=start_another)
    assert outcome.failures
    assert all("was computed by version 9.9" in str(failure) for failure in outcome.failures)
    assert outcome.computed + len(outcome.failures) == 30
    ours = re.escape(cluster.code_version())
    with pytest.raises(InputError, match=rf"this is soilmoist_ros {ours}, but the Dask worker tcp://\S+ has 9\.9"):
        run_campaign(campaign, tmp_path / "b", slow.simulate, scheduler=address.text)


@contextmanager
def dask_config(path):
    import dask.config

    before = deepcopy(dask.config.config)
    try:
        dask.config.refresh(paths=[str(path)], env={})
        yield
    finally:
        dask.config.config.clear()
        dask.config.config.update(before)


@pytest.mark.slow
def test_a_cluster_with_keys_computes_encrypted_and_refuses_others(tmp_path, slow, started):
    script = Path(__file__).resolve().parents[2] / "scripts" / "keystore"
    making = [script, tmp_path / "keys", "--cluster"]
    told = subprocess.run(making, check=True, capture_output=True, text=True).stdout
    config = Path(told.strip().removeprefix("export DASK_CONFIG="))
    assert {path.stat().st_mode & 0o077 for path in config.parent.iterdir()} == {0}
    assert subprocess.run(making, capture_output=True).returncode == 2, "keys are never replaced"
    started.environment["DASK_CONFIG"] = str(config)
    port = started.port()
    address = f"tls://127.0.0.1:{port}"
    scheduler = "-m", "distributed.cli.dask_scheduler", "--no-dashboard", "--host"
    started(*scheduler, address.rpartition(":")[0], "--port", port)
    started("-m", "distributed.cli.dask_worker", address, "--nthreads", 1, "--no-dashboard")
    with pytest.raises(InputError, match="keys"):
        cluster.connect(address, 1.0)
    with dask_config(config):
        wait_until(lambda: answers(address))
        run_campaign(load_campaign(written(tmp_path, 3)), tmp_path / "out", slow.simulate, scheduler=address)
        assert len(stored(tmp_path / "out")) == 3
        strange = tmp_path / "strange"
        subprocess.run([script, strange, "--cluster"], check=True, capture_output=True)
    with dask_config(strange / "dask.yaml"), pytest.raises(InputError):
        cluster.connect(address, 2.0)
    with pytest.raises(InputError):
        cluster.connect(address.replace("tls", "tcp"), 2.0)
