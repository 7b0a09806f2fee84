"""The disk margin of a periodic loop, against the time-invariant one and against growth over a turn."""

import numpy as np
import pytest

from flapgym.control import Weights, design_model, growth_per_turn, synthesise
from flapgym.control.channels import ROTOR
from flapgym.control.margins import disk_margin
from flapgym.control.periodic import periodic_disk_margin
from flapgym.state_space import StateSpace
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
FIERCE = synthesise(design_model(MODEL), Weights(rbm=1e3, acceleration=1e-4))


def _three(gains):
    """Copies of a blade's controller in the blades' own frames, each with a factor on the moment it measures."""
    each, factor = np.eye(3), [np.diag(gains), np.eye(3), np.eye(3)]
    return StateSpace(
        np.kron(each, FIERCE.A),
        np.hstack([np.kron(one, column[:, None]) for one, column in zip(factor, FIERCE.B.T, strict=True)]),
        np.kron(each, FIERCE.C),
        np.hstack([np.kron(one, column[:, None]) for one, column in zip(factor, FIERCE.D.T, strict=True)]),
        MODEL.time_step,
        ROTOR.inputs,
        ROTOR.outputs,
    )


def test_three_copies_have_the_margin_of_their_time_invariant_loop():
    expected = disk_margin(MODEL, FIERCE, frequency=np.linspace(0.01, 12.0, 6000))
    found = periodic_disk_margin(MODEL, _three([1.0, 1.0, 1.0]))
    assert expected.alpha < 1.0
    assert found.alpha == pytest.approx(expected.alpha, rel=5e-3)


def test_unlike_blades_stay_stable_within_their_margin():
    """Only blade 1 answers its moment, so the loop is periodic and no frame makes it anything else."""
    margin = periodic_disk_margin(MODEL, _three([1.0, 0.0, 0.0]))
    for gain in margin.gain:
        assert growth_per_turn(MODEL, _three([gain, 0.0, 0.0]), turns=8) < 1.0


def test_more_harmonics_change_nothing():
    alone = _three([1.0, 0.0, 0.0])
    few, many = (periodic_disk_margin(MODEL, alone, harmonics).alpha for harmonics in (1, 3))
    assert few == pytest.approx(many, rel=0.01)


def test_a_controller_of_one_blade_is_refused():
    with pytest.raises(ValueError, match="expected a controller of rbm_1, rbm_2, rbm_3, got one of rbm"):
        periodic_disk_margin(MODEL, FIERCE)
