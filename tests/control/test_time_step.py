"""What was sampled at another time step than the turbine's is refused wherever it meets the turbine."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import flapgym  # noqa: F401 (registers the environments)
from flapgym.control import (
    BladeController,
    PDGains,
    PredictiveController,
    Weights,
    closed_loop,
    design_model,
    growth_per_turn,
    pd_agent,
    save_agent,
    stability,
    stationary_rms,
)
from flapgym.control.channels import ROTOR
from flapgym.control.margins import delay_margin, disk_margin
from flapgym.control.periodic import periodic_disk_margin
from flapgym.core.state_space import StateSpace, series
from flapgym.envs.registration import TURBINE_ID
from flapgym.evaluation import compare, simulate
from flapgym.reduction import balance, relative_error
from flapgym.wind import von_karman_filter
from flapgym.wrappers.single import Residual
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
SLOW = 0.02
AGENT = pd_agent("mine", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))


def _slow(system: StateSpace) -> StateSpace:
    return replace(system, time_step=SLOW)


CONTROLLER = _slow(AGENT.system)
LABELLED = BladeController("mine", CONTROLLER, AGENT.start, AGENT.acceleration_limits)
ROTOR_CONTROLLER = StateSpace(
    np.zeros((0, 0)), np.zeros((0, 9)), np.zeros((3, 0)), np.zeros((3, 9)), SLOW, ROTOR.inputs, ROTOR.outputs
)
WIND = von_karman_filter(11.0, 0.1, 147.0, SLOW)

MEETINGS = {
    "closed_loop": lambda folder: closed_loop(MODEL, CONTROLLER),
    "closed_loop on a plant": lambda folder: closed_loop(MODEL, AGENT.system, plant=_slow(MODEL.turbine)),
    "stability": lambda folder: stability(MODEL, CONTROLLER),
    "growth_per_turn": lambda folder: growth_per_turn(MODEL, CONTROLLER),
    "stationary_rms": lambda folder: stationary_rms(MODEL, CONTROLLER),
    "stationary_rms of a plant": lambda folder: stationary_rms(MODEL, plant=_slow(MODEL.turbine)),
    "disk_margin": lambda folder: disk_margin(MODEL, CONTROLLER),
    "delay_margin": lambda folder: delay_margin(MODEL, CONTROLLER),
    "periodic_disk_margin": lambda folder: periodic_disk_margin(MODEL, ROTOR_CONTROLLER),
    "design_model of a plant": lambda folder: design_model(MODEL, _slow(MODEL.blade), WIND),
    "design_model of a wind": lambda folder: design_model(MODEL, disturbance=WIND),
    "save_agent": lambda folder: save_agent(folder / "mine.json", LABELLED, MODEL, "A test.", {}),
    "compare": lambda folder: compare([LABELLED], MODEL, realisations=1, duration=5.0),
    "simulate": lambda folder: simulate(LABELLED, MODEL, [1], 5.0),
    "Residual": lambda folder: Residual(
        gymnasium.make(TURBINE_ID, model=MODEL, task={"observe": AGENT.observe}, steps_per_action=1), LABELLED
    ),
    "series": lambda folder: series(WIND, MODEL.blade.select(["wind"])),
    "balance": lambda folder: balance(MODEL.blade.select(["wind"]), WIND),
    "relative_error": lambda folder: relative_error(
        MODEL.blade.select(["wind"]),
        _slow(MODEL.blade.select(["wind"])),
        von_karman_filter(11.0, 0.1, 147.0, 0.007),
    ),
    "a turbine model": lambda folder: replace(MODEL, blade=_slow(MODEL.blade)),
}


@pytest.mark.parametrize("meeting", MEETINGS.values(), ids=MEETINGS)
def test_another_time_step_is_refused_with_both(meeting, tmp_path):
    with pytest.raises(
        ValueError, match=r"time_step: expected 0.007 s.*got 0.02 s|time_step: expected 0.02 s.*got 0.007 s"
    ):
        meeting(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_time_step_that_rounding_alone_makes_another_is_the_same():
    rounded = replace(AGENT.system, time_step=0.1 * 0.07)
    assert rounded.time_step != MODEL.time_step
    ours, theirs = closed_loop(MODEL, rounded).A, closed_loop(MODEL, AGENT.system).A
    np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-15)


def test_a_predictive_controller_tells_its_own_time_step():
    agent = PredictiveController("mpc", MODEL, Weights(0.5))
    assert agent.time_step == MODEL.time_step
