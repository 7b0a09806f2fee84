"""Side effects and other turbines in the study: exact where they can be, and kept once made."""

from dataclasses import replace

import numpy as np
import pytest

from baselines.cache import Cache
from baselines.duty import Duty
from baselines.effects import Effects, further_loads, respond
from baselines.models import VARIATIONS, unscaled_flap
from baselines.paper.effects_section import effects_section
from baselines.paper.trials import Condition, Outcome, outcomes, trials_section
from baselines.scores import Trial
from flapgym.control import Weights, lqg_agent
from flapgym.control.growth import Growth
from flapgym.evaluation import Estimate, root_mean_square, simulate
from flapgym.turbine import load_case
from reference.study import STUDY_OUTPUTS
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
CHOSEN = ("rbm_0", "rbm_c", "rbm_s", "tower_fore_aft", "tower_side_side")
STUDIED = replace(MODEL.turbine.select(outputs=CHOSEN), outputs=STUDY_OUTPUTS)
"""The turbine asked a second time for what a record has."""


def test_blocks_of_steps_are_the_steps():
    rng = np.random.default_rng(0)
    inputs = rng.standard_normal((3, 150, 7))
    inputs[:, 0] = 0.0
    together = respond(MODEL.turbine, inputs, block=64)
    for one, expected in zip(together, inputs, strict=True):
        np.testing.assert_allclose(one, MODEL.turbine.simulate(expected), atol=1e-9 * np.abs(together).max())


def test_a_block_begins_in_the_steady_state_of_its_first_input():
    inputs = np.tile(np.random.default_rng(1).standard_normal((1, 1, 7)), (1, 40, 1))
    steady = respond(MODEL.turbine, inputs)
    np.testing.assert_allclose(steady[0], np.tile(steady[0, 0], (40, 1)), rtol=1e-9)
    np.testing.assert_allclose(steady[0, 0], MODEL.turbine.dc_gain() @ inputs[0, 0], rtol=1e-9)


def test_what_else_the_flaps_do_is_what_the_simulation_says_they_do():
    """Asked for the flapwise moments, the second calculation gives the record's, once its start is forgotten."""
    agent = lqg_agent("lqg", MODEL, Weights(30.0))
    record = simulate(agent, MODEL, [3, 4], 60.0)
    again, tower = further_loads(record, STUDIED, MODEL.rotor_speed)
    late_half = slice(again.shape[1] // 2, None)
    error = root_mean_square((again - record.rbm)[:, late_half], axis=1)
    assert (error < 0.02 * root_mean_square(record.rbm, axis=1)).all()
    np.testing.assert_allclose(tower[:, late_half, 0], record.tower_fore_aft[:, late_half], atol=2e-3)


def test_variations_change_one_thing_each():
    case = load_case("nrel5mw-rated")
    hashes = {
        case.hash(),
        unscaled_flap(case).hash(),
        *(change(case).hash() for change in VARIATIONS.values()),
    }
    assert len(hashes) == 2 + len(VARIATIONS)
    slower = VARIATIONS["wind 8 m/s"](case)
    assert slower.rotor_speed == pytest.approx(case.rotor_speed * 8.0 / 11.0)


def test_an_outcome_is_against_open_loop_under_the_same_condition(tmp_path):
    agent = lqg_agent("lqg", MODEL, Weights(30.0))
    trial, cache = Trial("trial", 2, 6.0), Cache(tmp_path, "a")
    found = {
        condition.label: outcomes({"lqg": agent}, condition, trial, cache, lambda name: None)
        for condition in (
            Condition("as designed", MODEL),
            Condition("noise", MODEL, {"sensors": {"noise": 0.5 * MODEL.rbm_rms}}),
            Condition("late", MODEL, {"sensors": {"delay": 40 * MODEL.time_step}}),
        )
    }
    designed, noise, delayed = (row["lqg"] for row in found.values())
    assert designed.grows is None
    assert designed.rbm_rms.mean < -0.05
    assert noise.flap_travel > designed.flap_travel
    assert delayed.rbm_rms.mean > designed.rbm_rms.mean
    text = " ".join(part for part in trials_section(found, trial).parts if isinstance(part, str))
    assert "lqg loses most under noise" in text


def test_an_unstable_loop_is_marked():
    change = Estimate(-0.1, -0.2, 0.0)
    section = trials_section(
        {"heavy": {"pd": Outcome(change, change, 0.1, Growth(3.85, 47.0))}}, Trial("trial", 2, 6.0)
    )
    assert section.content[1].rows[0][1] == "-10.0 / -10.0*"
    assert section.content[3].rows == (("heavy", "pd", "3.85", "47"),)


def test_effects_are_told_against_open_loop_and_the_base_case():
    one = np.full(3, 1.0)
    calm, duty = Effects(*([one] * 6)), Duty(*([one] * 6))
    found = {
        "lqg": (calm, duty),
        "pd": (replace(calm, edge_rms=1.1 * one), replace(duty, inertial_power=1.7 * one)),
    }
    section = effects_section(found, {"lqg": "LQG", "pd": "PD"}, calm, 3)
    assert section.content[1].rows[1][5].startswith("+10.0")
    assert section.content[3].rows[1][4] == "1.70"
    assert "+70 % of inertial" in section.conclusions[-1]
