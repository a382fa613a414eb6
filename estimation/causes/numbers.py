"""The numbers that decide a diagnosis.

They were set by hand and are not calibrated yet: a command must choose them on drawn campaigns.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Numbers:
    """What decides between hypotheses.

    Attributes:
        samples_a_run: Independent samples that a run is worth, against one of its mean.
        form_floor: Share of an equation's declared error that counts as form, not as a cause.
        between_weight: Weight of the score between runs against that within runs.
        between_floor: Share of the error within runs below which run means carry no evidence.
        knot_sd: Prior standard deviation of a smooth function's knot, of the declared error.
        sharpness: Log odds for one unit of score.
        cause_cost: Log prior odds against a cause.
        function_cost: Further log prior odds against an unknown form.
        bend_share: Prior standard deviation of a form's deviation from its equation, as a share.
        kept_evidence: E-value on the test runs from which a cause is kept.
    """

    samples_a_run: float = 40.0
    form_floor: float = 0.02
    between_weight: float = 0.25
    between_floor: float = 0.25
    knot_sd: float = 2.0
    sharpness: float = 25.0
    cause_cost: float = 2.0
    function_cost: float = 2.0
    bend_share: float = 0.3
    kept_evidence: float = 20.0


DEFAULT = Numbers()
