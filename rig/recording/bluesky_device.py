"""A rig as a device of bluesky: each trigger records one run of a protocol into a log.

    from bluesky.plans import list_scan
    from bluesky.run_engine import RunEngine
    from ophyd_async.core import init_devices
    from rig.recording.bluesky_device import RecordedRuns

    engine = RunEngine()
    with init_devices():
        rig = RecordedRuns("pty", "quick", "logs/scan")
    engine(list_scan([rig], rig.run, range(len(rig.names))))

The session opens when the device is staged and ends, disarmed, when it is unstaged; a plan that is
aborted ends the run at its next samples. The samples stay in the logs, which bluesky's documents
name. Needs the extra `bluesky`.
"""

import asyncio
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import TypeVar

from bluesky.protocols import Triggerable
from ophyd_async.core import AsyncStatus, StandardReadable, soft_signal_r_and_setter, soft_signal_rw

from rig.bench.logger import open_logger
from rig.bench.session import Session
from rig.configuration.check import refuse_problems
from rig.configuration.config import load_config
from rig.errors import RigError, UsageError
from rig.protocols.protocol import Plan, load_protocol
from rig.recording.campaign import RunResult, open_campaign_folder, record_campaign

Result = TypeVar("Result")


class AbortedError(RigError):
    """The device is not staged, or the plan ended before the run did."""


class RecordedRuns(StandardReadable, Triggerable):
    """The runs of a protocol on a rig, one a trigger.

    Attributes:
        folder: Folder of the logs.
        names: Names of the runs, in the order of their numbers.
        run: Signal: number of the run that the next trigger records.
        log_path: Signal: path of the log of the last one.
        samples, lost: Signals: samples recorded, and lost on the way from the logger.
        remark: Signal: what was not as planned; empty where all was.
    """

    def __init__(
        self, config: Path | str, protocol: str, folder: Path | str, notes: str = "", name: str = ""
    ) -> None:
        """Prepare a campaign; nothing is connected before the device is staged.

        Configuration and protocol are files, or names of shipped ones. The folder of the logs is
        new or empty, the notes are stored in every log, and the name is the device's in bluesky's
        documents.

        Raises:
            UsageError: A file is wrong, or the folder is in use.
        """
        self._config = load_config(Path(config))
        refuse_problems(self._config)
        self.folder, self._notes = Path(folder), notes
        self._plans = open_campaign_folder(
            self.folder, load_protocol(protocol), self._config, resume=False
        )
        self.names = tuple(plan.name for plan in self._plans)
        self._plan = self._plans[0]
        self._results: Iterator[RunResult] = iter(())
        self._ways_out = ExitStack()
        self._closing = threading.Event()
        self._closing.set()
        self._thread = ThreadPoolExecutor(1)  # a session is read by one thread
        with self.add_children_as_readables():
            self.run = soft_signal_rw(int, 0)
            self.log_path, self._set_log_path = soft_signal_r_and_setter(str)
            self.samples, self._set_samples = soft_signal_r_and_setter(int)
            self.lost, self._set_lost = soft_signal_r_and_setter(int)
            self.remark, self._set_remark = soft_signal_r_and_setter(str)
        super().__init__(name)

    @AsyncStatus.wrap
    async def stage(self) -> None:
        """Connect to the rig; it stays disarmed."""
        await super().stage()
        await self._in_thread(self._open)

    @AsyncStatus.wrap
    async def trigger(self) -> None:
        """Record the run whose number is set."""
        number = await self.run.get_value()
        if not 0 <= number < len(self._plans):
            raise UsageError(
                f"There is no run {number}.", f"Their numbers are 0 to {len(self._plans) - 1}."
            )
        self._plan = self._plans[number]
        try:
            result = await self._in_thread(self._record)
        except asyncio.CancelledError:
            self._closing.set()
            raise
        self._set_log_path(str(result.path))
        self._set_samples(result.samples)
        self._set_lost(result.lost)
        self._set_remark(result.remark)

    @AsyncStatus.wrap
    async def unstage(self) -> None:
        """Disarm the rig, confirmed by it, and close the session."""
        self._closing.set()
        await self._in_thread(self._ways_out.close)
        await super().unstage()

    def _open(self) -> None:
        self._closing.clear()
        session = self._ways_out.enter_context(Session(self._config, open_logger(self._config)))
        plans: Iterator[Plan] = iter(lambda: self._plan, None)
        self._results = record_campaign(
            session, plans, self.folder, notes=self._notes, on_progress=self._go_on
        )

    def _record(self) -> RunResult:
        if self._closing.is_set():
            raise AbortedError("There is no session with the rig.", fix="Stage the device first.")
        return next(self._results)

    def _go_on(self, name: str, taken: int, expected: int) -> None:
        if self._closing.is_set():
            raise AbortedError(f"{name} was aborted after {taken} of {expected} samples.")

    async def _in_thread(self, work: Callable[[], Result]) -> Result:
        return await asyncio.get_running_loop().run_in_executor(self._thread, work)
