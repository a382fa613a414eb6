"""The numbers that decide a diagnosis.

`python -m benchmarks.diagnosis.calibrate` measures on drawn campaigns which `sharpness`,
`cause_cost`, `rare_cost` and `choice_price` give the truth the best mean log probability, see
docs/results/diagnosis-numbers.md. Five blocks of campaigns were measured. The best `sharpness` is
6, 16, 6, 10 and 10 there. The best costs are the shipped ones or less on the first three, a
`cause_cost` of .2 on the last two; the shipped values are within .06 of the best on each. A larger
cost keeps more clean campaigns without a cause and loses weak effects. All others were set by hand
while the core was developed on campaigns of the develop range.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Numbers:
    """The numbers that decide between hypotheses.

    Attributes:
        samples_a_run: Independent samples that a run is worth, against one of its mean.
        form_floor: Share of an equation's declared error that counts as form, not as a cause.
        between: Weight of the score between runs against that within runs, and share of the error
            within runs below which run means carry no evidence.
        knot_sd: Prior standard deviation of a smooth function's knot, of the declared error.
        bend_share: Prior standard deviation of a form's deviation from its equation, as a share.
        sharpness: Log odds between two causes for one unit of score.
        choice_price: Score that one unit of the logarithm of the number of choices costs.
        cause_cost: Further score that a cause costs.
        rare_cost: Further score that an unknown form costs, and acting in some of the runs only.
        kept_evidence: E-value on the test runs from which a cause is kept.
        least_shown: Share of a cause's gain by which the logarithm of some equation's error on the
            test runs falls, next to all other causes or to those added before.
        runs_a_test_run: One run in so many is a test run.
        least_to_name: Training runs from which an effect is named: a sign test over one fewer
            cannot reach 5 %.
    """

    samples_a_run: float = 40.0
    form_floor: float = 0.02
    between: float = 0.25
    knot_sd: float = 2.0
    bend_share: float = 0.3
    sharpness: float = 10.0
    choice_price: float = 0.02
    cause_cost: float = 0.1
    rare_cost: float = 0.16
    kept_evidence: float = 20.0
    least_shown: float = 0.1
    runs_a_test_run: int = 3
    least_to_name: int = 5


DEFAULT = Numbers()
