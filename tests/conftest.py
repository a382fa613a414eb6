"""Fixtures every room's tests share."""

import os
import threading
from collections.abc import Iterator
from pathlib import Path

# before numpy is loaded: threads of a BLAS wait for one another when tests run side by side
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

# compiled code is slow the first time, and a deadline is a wall clock in disguise
settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def measured_data() -> Path:
    """Folder of the measured data sets; the test is skipped, visibly, where it is absent."""
    folder = Path(os.environ.get("RIG_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no measured data at {folder} (set RIG_DATA to its folder)")
    return folder


@pytest.fixture(autouse=True)
def no_thread_is_left_behind() -> Iterator[None]:
    """Fail a test that leaves a thread of its own running."""
    before = set(threading.enumerate())
    yield
    left = [t for t in threading.enumerate() if t not in before and t.is_alive() and not t.daemon]
    assert not left, f"threads still running: {left}"
