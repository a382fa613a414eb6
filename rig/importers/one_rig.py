"""Runs that are opened together are of one rig and one instrument.

Which ones they are of stands in the recordings, and these are read one at a time: the first that is
read sets the rig and the instrument, and the first that differs is refused.
"""

from dataclasses import replace
from functools import partial

from estimation.campaign import Campaign, Run
from estimation.recording import Recording
from rig.errors import DataError


class MixedRunsError(DataError):
    """Runs of different rigs or instruments were opened as one campaign."""


def of_one_rig(campaign: Campaign) -> Campaign:
    """Return the campaign with runs that refuse to be read together with another rig's.

    Reading a run raises MixedRunsError where an earlier one was of another rig or instrument.
    Excluded runs are not compared.
    """
    first: dict[str, tuple[str, str]] = {}
    return Campaign(tuple(replace(r, load=partial(_checked, r, first)) for r in campaign.runs))


def _checked(run: Run, first: dict[str, tuple[str, str]]) -> Recording:
    """Read a run; `first` holds each property of the first run, and that run's name."""
    recording = run.load()
    if run.excluded is not None or recording.excluded is not None:
        return recording
    own = recording.instrument
    instrument = " ".join(part for part in (own.model, own.serial) if part) or "an unnamed one"
    for what, value in (("rigs", recording.rig or "an unnamed one"), ("instruments", instrument)):
        known, name = first.setdefault(what, (value, run.name))
        if known != value:
            raise MixedRunsError(
                f"The runs are of several {what}: {name} of {known}, {run.name} of {value}.",
                f"What differs between {what} would be taken for an effect.",
                "Give the folder of one of them.",
            )
    return recording
