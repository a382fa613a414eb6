"""Fixtures every room's tests share."""

import os
import shutil
import signal
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

# before numpy is loaded: threads of a BLAS wait for one another when tests run side by side
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# commands that are typed without a configuration are about the simulated rig in the tests
os.environ["RIG_CONFIG"] = "simulated"
# a person's own configurations, calibrations, models and logs of use are none of the tests'
os.environ["XDG_CONFIG_HOME"] = tempfile.mkdtemp(prefix="rig-tests-")
os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="rig-tests-")

import pytest
from hypothesis import HealthCheck, settings

from drivers.teensy.core import firmware_library

# compiled code is slow the first time, and a deadline is a wall clock in disguise; examples
# differ from run to run, so half of the usual hundred are enough; they may share a folder
SHARED = [HealthCheck.function_scoped_fixture]
settings.register_profile("quick", deadline=None, max_examples=50, suppress_health_check=SHARED)
settings.load_profile("quick")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def measured_data() -> Path:
    """Folder of the measured data sets; the test is skipped, visibly, where it is absent."""
    folder = Path(os.environ.get("RIG_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no measured data at {folder} (set RIG_DATA to its folder)")
    return folder


@pytest.fixture(scope="session")
def library() -> Path:
    """The firmware library, built from the present source; skipped where that cannot be.

    RIG_FIRMWARE_LIBRARY names another one: that of a core that was damaged on purpose.
    """
    if "RIG_FIRMWARE_LIBRARY" in os.environ:
        return Path(os.environ["RIG_FIRMWARE_LIBRARY"])
    if shutil.which("make") is None or shutil.which("g++") is None:
        found = firmware_library()
        if found is None:
            pytest.skip(
                "the firmware library is not built and there is no g++ and make to build it"
            )
        return found
    subprocess.run(["make", "-C", str(ROOT / "firmware")], check=True, capture_output=True)
    found = firmware_library()
    assert found is not None
    return found


@pytest.fixture
def hang_up_is_heard() -> Iterator[None]:
    """SIGHUP as a program in a terminal has it, also where the tests run with `nohup`."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture(autouse=True)
def no_thread_is_left_behind() -> Iterator[None]:
    """Fail a test that leaves a thread of its own running."""
    before = set(threading.enumerate())
    yield
    others = [t for t in threading.enumerate() if t not in before and not t.daemon]
    for thread in others:
        thread.join(1.0)  # one that was asked to end is about to
    left = [t for t in others if t.is_alive()]
    assert not left, f"threads still running: {left}"
