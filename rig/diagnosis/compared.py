"""Two campaigns of one machine compared: recorded paths in periods, an arm with its links."""

from collections.abc import Sequence

from estimation.arm.balances import balances_of
from estimation.arm.shared import laid_out
from estimation.campaign import Campaign
from estimation.changes.compare import compare
from estimation.changes.difference import Difference
from estimation.diagnosis.paths import periods
from estimation.diagnosis.split import SplitError
from estimation.model import Model
from estimation.recording import Recording


def compared(
    a: Campaign, b: Campaign, models: Sequence[Model], on: Campaign | None = None, seed: int = 0
) -> Difference:
    """Find what changed from one campaign to another.

    A campaign of one recorded path is cut into its whole periods. The links of an arm, which all
    joints share, are fitted on both campaigns: they have not changed.

    Args:
        a: The first campaign.
        b: The second one.
        models: Declared models, one an equation.
        on: A third campaign, to predict.
        seed: Seed of the random choices of runs.

    Raises:
        ChangesError: Too few runs.
        FitError: A declared equation cannot be identified.
    """
    runs = [_runs(campaign) for campaign in (a, b)]
    third = [] if on is None else _runs(on)
    of_arm = any(model.balance.startswith("joint.") for model in models)
    arm = balances_of(runs[0][0]) if of_arm and runs[0] else None
    if arm is not None:
        both = [run.name for run in (*runs[0], *runs[1])]
        whole = laid_out(arm, [*runs[0], *runs[1], *third], both)
        first, second = len(runs[0]), len(both)
        runs, third = [whole[:first], whole[first:second]], whole[second:]
    return compare(runs[0], runs[1], models, third, seed)


def _runs(campaign: Campaign) -> list[Recording]:
    recordings = list(campaign.evidence)
    if len(recordings) != 1:
        return recordings
    try:
        return periods(recordings[0])
    except SplitError:  # one run, and no path of several periods
        return recordings
