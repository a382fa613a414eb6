"""Draw `docs/figures/notebook.png`: what `rig.plot` returns for the run of the notebook.

python docs/figures/notebook.py
"""

from pathlib import Path

import rig

OUT = Path(__file__).with_suffix(".png")


def draw() -> None:
    """Draw the first run of the notebook's campaign with the fitted model."""
    campaign = rig.simulate("quick", hide={"motor_ripple": 1.0}, seed=1)
    (model,) = rig.declared("motor")
    figure = rig.plot(campaign.runs[0].recording(), rig.fit(campaign, model))
    figure.savefig(OUT, dpi=100)


if __name__ == "__main__":
    draw()
