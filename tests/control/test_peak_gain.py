"""The largest gain of a system against gains known by heart and against a search that knows nothing of levels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag

from flapgym.control.peak_gain import TOLERANCE, peak_gain
from flapgym.core.state_space import StateSpace
from tests.loops import gain_at, searched_peak

STEP = 0.01


def _system(a, b, c, d):
    a, b, c, d = (np.atleast_2d(np.asarray(matrix, dtype=float)) for matrix in (a, b, c, d))
    names = [f"u{i}" for i in range(b.shape[1])], [f"y{i}" for i in range(c.shape[0])]
    return StateSpace(a, b, c, d, STEP, tuple(names[0]), tuple(names[1]))


@pytest.mark.parametrize(
    ("system", "gain", "frequency"),
    [
        (_system(0.9, 1.0, 1.0, 0.0), 10.0, 0.0),
        (_system(-0.9, 1.0, 1.0, 0.0), 10.0, 0.5 / STEP),
        (_system(0.9, 1.0, 1.0, -10.0), abs(1.0 / -1.9 - 10.0), 0.5 / STEP),
    ],
)
def test_a_lag_has_its_peak_at_an_end(system, gain, frequency):
    found, at = peak_gain(system)
    assert found == pytest.approx(gain, rel=1e-9)
    assert at == pytest.approx(frequency, abs=1e-6)


def test_a_gain_that_is_the_same_everywhere_is_found():
    """(1 - 0.8 z) / (z - 0.8) turns the phase and nothing else."""
    assert peak_gain(_system(0.8, 1.0, 1.0 - 0.8**2, -0.8))[0] == pytest.approx(1.0, rel=1e-9)
    assert peak_gain(_system(np.zeros((1, 1)), 0.0, 0.0, 3.0))[0] == pytest.approx(3.0, rel=1e-9)


@pytest.mark.parametrize("steps", [2, 16])
def test_a_comb_that_lets_neither_end_pass_doubles_what_lies_between(steps):
    """1 - z^-steps."""
    found, at = peak_gain(_system(np.eye(steps, k=-1), np.eye(steps, 1), -np.eye(steps)[-1:], 1.0))
    assert found == pytest.approx(2.0, rel=2 * TOLERANCE)
    assert (at * STEP * steps) % 1.0 == pytest.approx(0.5, abs=1e-3)


def test_what_answers_nothing_has_no_gain():
    assert peak_gain(_system(0.5, 1.0, 0.0, 0.0)) == (0.0, 0.0)


@pytest.mark.parametrize("seed", range(12))
def test_a_system_drawn_at_random_has_the_peak_a_search_finds(seed):
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((7, 7))
    a *= rng.uniform(0.8, 0.999) / np.abs(np.linalg.eigvals(a)).max()
    system = _system(a, rng.standard_normal((7, 3)), rng.standard_normal((2, 7)), rng.standard_normal((2, 3)))
    found, at = peak_gain(system)
    assert found == pytest.approx(searched_peak(system, np.linspace(0.0, np.pi, 4001)), rel=2 * TOLERANCE)
    assert gain_at(system, 2.0 * np.pi * at * STEP) == pytest.approx(found, rel=1e-9)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    frequency=st.floats(0.1, 40.0),
    damping=st.floats(-6.0, -2.0).map(lambda power: 10.0**power),
    size=st.floats(1.1, 20.0),
    phase=st.floats(0.0, 2.0 * np.pi),
)
def test_a_mode_however_narrow_is_not_passed_by(frequency, damping, size, phase):
    """Beside a broad response of gain 2: one mode, its own height given over the broad one's."""
    pole = np.exp(2j * np.pi * frequency * STEP * (1j - damping))
    read = 2.0 * size * (1.0 - abs(pole)) * np.exp(1j * phase)
    a = block_diag(0.5, [[pole.real, -pole.imag], [pole.imag, pole.real]])
    system = _system(a, [[1.0], [1.0], [0.0]], [[1.0, read.real, read.imag]], 0.0)
    width = 2.0 * np.pi * frequency * STEP * damping
    near = np.angle(pole) + width * np.linspace(-30.0, 30.0, 601)
    angles = np.unique(np.clip(np.concatenate([np.linspace(0.0, np.pi, 501), near]), 0.0, np.pi))
    assert peak_gain(system)[0] == pytest.approx(searched_peak(system, angles), rel=2 * TOLERANCE)


def test_an_unstable_system_has_no_gain():
    with pytest.raises(ValueError, match=r"expected a stable system, got spectral radius 1\.01"):
        peak_gain(_system(1.01, 1.0, 1.0, 0.0))
