"""End a stream of blocks after a given device time."""

from collections.abc import Generator, Iterator

from rig.live.block import SampleBlock


def until(blocks: Iterator[SampleBlock], duration_s: float | None) -> Iterator[SampleBlock]:
    """Yield blocks until they span a duration of device time; closing it closes the source.

    Args:
        blocks: The stream.
        duration_s: Device time to show, s; None for no end.
    """
    first_s: float | None = None
    try:
        for block in blocks:
            yield block
            if len(block) == 0 or duration_s is None:
                continue
            first_s = float(block.time_s[0]) if first_s is None else first_s
            if float(block.time_s[-1]) - first_s >= duration_s:
                return
    finally:
        if isinstance(blocks, Generator):
            blocks.close()
