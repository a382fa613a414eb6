"""State in an estimator's file what it was made from."""

from collections.abc import Mapping
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import rig
from estimation.campaign import Campaign
from estimation.estimators.adaptation import Adaptable
from estimation.estimators.origin import HASH_DIGITS, Origin, data_hash
from rig.output.provenance import commit, now_utc


def with_origin(
    estimator: Adaptable,
    campaign: Campaign,
    figures: Mapping[str, float],
    source: Path | None = None,
) -> Adaptable:
    """Return an estimator that carries the hashes of its data, the code and its errors.

    The campaign is that of its fit or adaptation, excluded runs left out; figures are errors in SI
    units. `source` is the file of the estimator it was adapted from, if any.
    """
    origin = Origin(
        made_at=now_utc(),
        code=f"rig {rig.__version__}, commit {commit(Path(rig.__file__).parents[1])}",
        data={recording.name: data_hash(recording) for recording in campaign.evidence},
        figures=dict(figures),
        adapted_from=file_hash(source) if source is not None else "",
        is_simulated=any(recording.is_simulated for recording in campaign.evidence),
    )
    return replace(estimator, origin=origin)


def file_hash(path: Path) -> str:
    """Return the hash of a file."""
    return sha256(path.read_bytes()).hexdigest()[:HASH_DIGITS]
