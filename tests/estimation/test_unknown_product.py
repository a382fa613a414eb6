"""Terms of a formula: as any effect, they run live as offline and stand in a model file."""

import pickle
from itertools import product as pairs

import numpy as np
import pytest

from estimation.effects import UnknownEffectError, catalogue, effect
from estimation.effects.unknown_product import FORMS
from estimation.model import Estimate, Model, Term
from estimation.model_file import parse, to_toml

EVERY = [*((f,) for f in FORMS), *pairs(FORMS, FORMS)]
CHANNELS = {"first": "spindle_angle_rad", "second": "motor_velocity_rad_s"}


def term_of(*forms: str) -> Term:
    kind = effect(".".join(("unknown", *forms)))
    sizes = {"place": 0.7, "order": 2.5, "width": 0.2}
    values = {p.name: Estimate(sizes[p.name.split("_")[1]]) for p in kind.shape}
    channels = {role: CHANNELS[role] for role in kind.roles}
    return Term(kind, -1, channels, values | {"amplitude": Estimate(0.02)})


@pytest.mark.parametrize("forms", EVERY, ids=".".join)
def test_columns_and_live_steps_agree_also_after_a_sample_that_is_not_finite(forms):
    kind = effect(".".join(("unknown", *forms)))
    random = np.random.default_rng(3)
    inputs = {role: np.cumsum(random.normal(size=200)) * 0.1 for role in kind.roles}
    inputs["first"][50] = np.nan
    shape = [1.7 if p.name.endswith("order") else 0.3 for p in kind.shape]
    columns = kind.columns(inputs, shape)[:, 0]
    state = kind.start()
    live = [
        kind.step(dict(zip(inputs, row, strict=True)), shape, state)[0]
        for row in np.column_stack(list(inputs.values())).tolist()
    ]
    assert np.isfinite(columns[51:]).all()
    assert live == pytest.approx(columns, rel=1e-12, abs=1e-12, nan_ok=True)


@pytest.mark.parametrize("forms", EVERY, ids=".".join)
def test_a_model_file_holds_it_with_units(forms):
    term = term_of(*forms)
    model = Model("made", "motor", "proximal_torque_n_m", (term,))
    again = parse(to_toml(model))
    assert again == model
    assert pickle.loads(pickle.dumps(term)) == term  # noqa: S301 - made here
    assert term.unit(term.effect.amplitudes[0], model.target).startswith("N m")


def test_play_is_crossed_after_each_reversal():
    travel = np.array([0.0, 0.1, 0.2, 0.15, 0.0, -0.3])
    crossed = effect("unknown.play").columns({"first": travel}, [0.1])[:, 0]
    assert crossed == pytest.approx([0.0, 1.0, 1.0, 0.5, -1.0, -1.0])


def test_no_formula_is_searched_as_if_it_were_of_the_catalogue():
    assert not [name for name in catalogue() if name.startswith("unknown")]


@pytest.mark.parametrize("name", ["unknown", "unknown.", "unknown.exec", "unknown.sign.sign.sign"])
def test_what_is_no_product_of_known_forms_is_refused(name):
    with pytest.raises(UnknownEffectError, match=r"formulas: unknown\.FORM"):
        effect(name)
