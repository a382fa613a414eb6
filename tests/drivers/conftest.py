"""Shared by the drivers' tests. None watches the wall clock: compiling is slow the first time."""

import shutil
import subprocess
from pathlib import Path

import pytest

from drivers.teensy.firmware_fake import firmware_library

FIRMWARE = Path(__file__).parents[2] / "firmware"


@pytest.fixture(scope="session")
def library() -> Path:
    """The firmware library, built from the present source; skipped where that cannot be."""
    if shutil.which("make") is None or shutil.which("g++") is None:
        found = firmware_library()
        if found is None:
            pytest.skip(
                "the firmware library is not built and there is no g++ and make to build it"
            )
        return found
    subprocess.run(["make", "-C", str(FIRMWARE)], check=True, capture_output=True)
    found = firmware_library()
    assert found is not None
    return found
