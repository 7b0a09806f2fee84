"""The disk margin of a periodic loop, against the time-invariant one and against growth over a turn."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.control import Weights, closed_loop, design_model, growth_per_turn, synthesise
from flapgym.control.channels import ROTOR
from flapgym.control.closed_loop import with_effectiveness
from flapgym.control.margins import disk_margin
from flapgym.control.periodic import TOLERANCE, periodic_disk_margin
from flapgym.core.state_space import StateSpace
from tests.loops import NARROW, with_narrow_mode
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
FIERCE = synthesise(design_model(MODEL), Weights(rbm=1e3, acceleration=1e-4))
MILD = synthesise(design_model(MODEL), Weights(rbm=3.0))


def _three(gains, one_blade=FIERCE):
    """Copies of a blade's controller in the blades' own frames, each with a factor on the moment it measures."""
    each, factor = np.eye(3), [np.diag(gains), np.eye(3), np.eye(3)]
    return StateSpace(
        np.kron(each, one_blade.A),
        np.hstack([np.kron(one, column[:, None]) for one, column in zip(factor, one_blade.B.T, strict=True)]),
        np.kron(each, one_blade.C),
        np.hstack([np.kron(one, column[:, None]) for one, column in zip(factor, one_blade.D.T, strict=True)]),
        MODEL.time_step,
        ROTOR.inputs,
        ROTOR.outputs,
    )


def test_three_copies_have_the_margin_of_their_time_invariant_loop():
    expected = disk_margin(MODEL, FIERCE)
    found = periodic_disk_margin(MODEL, _three([1.0, 1.0, 1.0]))
    assert expected.alpha < 1.0
    assert found.alpha == pytest.approx(expected.alpha, rel=2 * TOLERANCE)
    assert found.frequency == pytest.approx(expected.frequency, abs=1e-3)


def test_a_mode_far_narrower_than_the_first_intervals_is_seen():
    """Half a millihertz wide, where the first frequencies looked at lie six apart."""
    model = replace(MODEL, turbine=with_narrow_mode(MODEL.turbine))
    expected = disk_margin(model, MILD)
    found = periodic_disk_margin(model, _three([1.0, 1.0, 1.0], MILD))
    assert expected.frequency == pytest.approx(NARROW, abs=0.01)
    assert found.alpha == pytest.approx(expected.alpha, rel=2 * TOLERANCE)


def test_a_periodic_loop_that_grows_has_no_margin():
    wild = _three([30.0, 0.0, 0.0])
    assert growth_per_turn(MODEL, wild, turns=8) > 1.0
    assert periodic_disk_margin(MODEL, wild).alpha == 0.0


def test_growth_that_leaves_the_range_of_numbers_within_the_turns_is_that_of_the_eigenvalue():
    stronger = replace(MODEL, turbine=with_effectiveness(MODEL.turbine, 10.0))
    steps = 2.0 * np.pi / (MODEL.rotor_speed * MODEL.time_step)
    expected = closed_loop(stronger, FIERCE).spectral_radius()
    assert expected > 1.5
    found = growth_per_turn(stronger, _three([1.0, 1.0, 1.0]), turns=8)
    assert np.log(found) == pytest.approx(steps * np.log(expected), rel=0.01)


def test_unlike_blades_stay_stable_within_their_margin():
    """Only blade 1 answers its moment, so the loop is periodic and no frame makes it anything else."""
    margin = periodic_disk_margin(MODEL, _three([1.0, 0.0, 0.0]))
    for gain in margin.gain:
        assert growth_per_turn(MODEL, _three([gain, 0.0, 0.0]), turns=8) < 1.0


def test_more_harmonics_change_nothing():
    alone = _three([1.0, 0.0, 0.0])
    few, many = (periodic_disk_margin(MODEL, alone, harmonics).alpha for harmonics in (1, 2))
    assert few == pytest.approx(many, rel=2 * TOLERANCE)


def test_a_controller_of_one_blade_is_refused():
    with pytest.raises(ValueError, match="expected a controller of rbm_1, rbm_2, rbm_3, got one of rbm"):
        periodic_disk_margin(MODEL, FIERCE)
