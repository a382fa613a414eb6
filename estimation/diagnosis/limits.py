"""What a diagnosis cannot tell, in words."""

from collections.abc import Mapping

from estimation.diagnosis.gates import Gates
from estimation.diagnosis.instruments import FORCES
from estimation.diagnosis.split import LEAST_TO_NAME, Sealed
from estimation.diagnosis.story import Story


def limits(
    sealed: Sealed, twins: Mapping[str, object] | None, stories: Mapping[str, Story], gates: Gates
) -> list[str]:
    """Return what the diagnosis cannot tell.

    Args:
        sealed: The split.
        twins: Makers of simulated twins, if any.
        stories: Balance to its story, the confirm runs opened.
        gates: What an effect had to pass.
    """
    notes = []
    if not sealed.may_name:
        notes.append(
            f"{len(sealed.discover)} runs discover; with fewer than {LEAST_TO_NAME} no effect is"
            " named."
        )
    if not twins:
        notes.append(
            "The search was held against shuffled residuals only, not against simulated twins of"
            " the declared model: artefacts of filters and feedback are not ruled out that way."
        )
    for name, story in stories.items():
        used = sum(int(run.used.sum()) for run in story.confirm)
        valid = sum(int(run.valid.sum()) for run in story.confirm)
        if story.unused:
            notes.append(f"{name}: without a usable sample: {', '.join(story.unused)}.")
        if story.own_share < gates.told:
            notes.append(_gain_hardly_told(name, story))
        if used < valid:
            notes.append(
                f"{name}: reported errors count all samples; {1 - used / valid:.0%} of the confirm"
                " samples are at rest, where friction holds any torque: no fit, search or decision"
                " uses them."
            )
    notes += [
        f"{name}: not claimed: {what}." for name, story in stories.items() for what in story.refused
    ]
    return notes


def _gain_hardly_told(name: str, story: Story) -> str:
    """Return why no name stands alone in a balance, and what to record instead."""
    read = {c for term in story.balance.terms for _, c in term.channels if c in FORCES}
    return (
        f"{name}: no name stands alone here. Of {', '.join(sorted(read))} only"
        f" {story.own_share:.1%} is its own; the rest the other declared terms say too, as at one"
        " speed either way or at one load, so its gain can hardly be told. Record several speeds"
        " and loads, as `rig record --protocol diagnosis` does, and diagnose these runs with them."
    )
