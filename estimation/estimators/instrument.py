"""The instrument that an estimator was fitted on, and the refusal of any other one."""

from estimation.errors import EstimationError
from estimation.recording import Recording


class InstrumentError(EstimationError):
    """An estimator is applied to an instrument that it was not fitted on."""


def instrument_of(recording: Recording) -> str:
    """Return model, serial number and mounting of a recording's instrument, empty if not known."""
    own = recording.instrument
    mounting = own.mounting and f"(mounting {own.mounting})"
    return " ".join(part for part in (own.model, own.serial, mounting) if part)


def is_own(instrument: str, recording: Recording) -> bool:
    """Return whether a recording is of an instrument, as far as both are known."""
    return not instrument or instrument_of(recording) in ("", instrument)


def require_own(instrument: str, recording: Recording) -> None:
    """Refuse a recording of another instrument than that of the fit, as far as both are known.

    Raises:
        InstrumentError: The recording is of another instrument.
    """
    if not is_own(instrument, recording):
        other = instrument_of(recording)
        raise InstrumentError(
            f"The estimator was fitted on {instrument}, the recording is of {other}.",
            "Another instrument has other friction and another zero.",
            "Adapt it: rig adapt MODEL PATH --runs NAMES; or use rig replay --any-instrument.",
        )


def only_one(instruments: set[str]) -> str:
    """Return the one instrument of a campaign's recordings, empty where there are several."""
    return next(iter(instruments)) if len(instruments) == 1 else ""
