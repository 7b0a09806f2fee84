"""What grows in a loop is told by its eigenvalues, in whatever frame the controller works."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.control import OpenLoop, RotorController, Weights, design_model, lqg_agent, synthesise
from flapgym.control.channels import ROTOR
from flapgym.control.closed_loop import _in_frame, closed_loop, with_effectiveness
from flapgym.control.growth import Growth, agent_growth, growth
from flapgym.core.state_space import StateSpace
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
STRONG = replace(MODEL, turbine=with_effectiveness(MODEL.turbine, 10.0))


def _turning(radius, angle):
    a = radius * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return StateSpace(a, np.zeros((2, 0)), np.zeros((0, 2)), np.zeros((0, 0)), 0.01, (), ())


def test_a_mode_that_turns_and_grows_is_told():
    found = growth(_turning(1.001, 0.2))
    assert found.frequency == pytest.approx(0.2 / (2.0 * np.pi * 0.01))
    assert found.doubling_time == pytest.approx(0.01 * np.log(2.0) / np.log(1.001))
    assert str(found) == "grows at 3.18 Hz, doubling in 6.93 s"
    assert growth(_turning(0.999, 0.2)) is None


def test_what_neither_grows_nor_decays_never_settles():
    assert str(growth(_turning(1.0, 0.0))) == "never settles at 0.00 Hz"
    assert str(Growth(np.nan, 6.0)) == "grows, doubling in 6 s"


def test_three_copies_in_the_blades_own_frames_double_in_the_time_of_their_time_invariant_loop():
    agent = lqg_agent("lqg", MODEL, Weights(30.0))
    system = agent.system
    each = np.eye(3)
    copies = StateSpace(
        np.kron(each, system.A),
        np.hstack([np.kron(each, column[:, None]) for column in system.B.T]),
        np.kron(each, system.C),
        np.hstack([np.kron(each, column[:, None]) for column in system.D.T]),
        MODEL.time_step,
        ROTOR.inputs,
        ROTOR.outputs,
    )
    own = RotorController("own", copies, np.zeros((copies.order, 9)), (10.0,))
    expected = growth(closed_loop(STRONG, system)).doubling_time
    found = agent_growth(own, STRONG)
    assert np.isnan(found.frequency)
    assert found.doubling_time == pytest.approx(expected, rel=0.05)
    assert agent_growth(own, MODEL) is None


def test_a_controller_in_either_time_invariant_frame_has_one_growth():
    system = synthesise(design_model(MODEL), Weights(30.0))
    together = _in_frame(system, MODEL, MODEL.turbine)
    blade, rotor = (
        lqg_agent("blade", MODEL, Weights(30.0)),
        RotorController("rotor", together, np.zeros((together.order, 9)), (10.0,)),
    )
    assert agent_growth(rotor, STRONG).frequency == pytest.approx(agent_growth(blade, STRONG).frequency)
    assert agent_growth(OpenLoop(), STRONG) is None
