"""Discrete linear state space, the one form in which every stage hands its dynamics to the next.

x^{n+1} = A x^n + B u^n, y^n = C x^n + D u^n, with input and output at the same step (paper eq. 14).
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from flapgym.core.arrays import Array
from flapgym.core.wording import number, shown

SAME_STEP = 1e-9
"""Relative difference up to which two time steps are one, computed in different ways."""


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A discrete linear time-invariant system with named inputs and outputs.

    Parameters
    ----------
    A : (n, n), B : (n, nu), C : (ny, n), D : (ny, nu) float
        State, input, output and feedthrough matrices.
    time_step : float
        Sampling time [s].
    inputs, outputs : tuple of str
        One name per column of B and per row of C.

    Raises
    ------
    ValueError
        If the shapes do not fit each other or the names, or an entry is not finite.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    time_step: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __post_init__(self) -> None:
        for kind, names in (("inputs", self.inputs), ("outputs", self.outputs)):
            if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
                raise ValueError(f"state_space.{kind}: expected a tuple of names, got {shown(names)}")
        if not isinstance(self.A, np.ndarray) or self.A.ndim != 2:
            given = f"one of shape {self.A.shape}" if isinstance(self.A, np.ndarray) else shown(self.A)
            raise ValueError(f"state_space.A: expected a square array, got {given}")
        n, nu, ny = self.A.shape[0], len(self.inputs), len(self.outputs)
        for name, shape in {"A": (n, n), "B": (n, nu), "C": (ny, n), "D": (ny, nu)}.items():
            matrix = getattr(self, name)
            if not isinstance(matrix, np.ndarray):
                raise ValueError(
                    f"state_space.{name}: expected an array of shape {shape}, got {shown(matrix)}"
                )
            if matrix.shape != shape:
                raise ValueError(f"state_space.{name}: expected shape {shape}, got {matrix.shape}")
            if not np.isfinite(matrix).all():
                raise ValueError(f"state_space.{name}: expected finite entries, got NaN or infinity")
        for kind, names in (("inputs", self.inputs), ("outputs", self.outputs)):
            if len(set(names)) < len(names):
                raise ValueError(f"state_space.{kind}: expected distinct names, got {', '.join(names)}")
        if not 0.0 < self.time_step < math.inf:
            raise ValueError(
                f"state_space.time_step: expected a positive time [s], got {number(self.time_step)}"
            )

    @property
    def order(self) -> int:
        """Number of states."""
        return int(self.A.shape[0])

    def spectral_radius(self) -> float:
        """Largest modulus of the eigenvalues of A; the system is stable below one."""
        return float(np.abs(np.linalg.eigvals(self.A)).max(initial=0.0))

    def frequency_response(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Response at frequencies [Hz], shape (nf, ny, nu): output per unit harmonic input.

        The Schur form is computed once, so a further frequency costs O(n^2).
        """
        transfer = TransferFunction(self.A, self.B, self.C, self.D)
        z = np.exp(2j * np.pi * np.atleast_1d(np.asarray(frequency, dtype=float)) * self.time_step)
        return np.stack([transfer(value) for value in z])

    def dc_gain(self) -> Array:
        """Steady output per unit constant input, shape (ny, nu)."""
        return self.C @ np.linalg.solve(np.eye(self.order) - self.A, self.B) + self.D

    def select(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> StateSpace:
        """The same system with only the named inputs and outputs, in the order given."""
        for kind, given in (("inputs", inputs), ("outputs", outputs)):
            if isinstance(given, (str, Set)):  # a set has no order, a text is no list of names
                raise ValueError(f"state_space.{kind}: expected a list of names, got {shown(given)}")
        inputs = self.inputs if inputs is None else tuple(inputs)
        outputs = self.outputs if outputs is None else tuple(outputs)
        for known, wanted, kind in ((self.inputs, inputs, "inputs"), (self.outputs, outputs, "outputs")):
            if len(set(wanted)) < len(wanted):
                raise ValueError(f"state_space.{kind}: expected each name once, got {', '.join(wanted)}")
            unknown = [name for name in wanted if name not in known]
            if unknown:
                raise ValueError(f"state_space.{kind}: no {unknown[0]!r} among {', '.join(known)}")
        columns = [self.inputs.index(name) for name in inputs]
        rows = [self.outputs.index(name) for name in outputs]
        return replace(
            self,
            B=self.B[:, columns],
            C=self.C[rows],
            D=self.D[np.ix_(rows, columns)],
            inputs=inputs,
            outputs=outputs,
        )

    def stationary_covariance(self) -> Array:
        """State covariance under white noise of unit variance on every input: P = A P A' + B B'."""
        return np.asarray(scipy.linalg.solve_discrete_lyapunov(self.A, self.B @ self.B.T))

    def simulate(self, u: ArrayLike, x0: ArrayLike | None = None) -> Array:
        """Outputs (T, ny) for inputs u (T, nu) from state x0 (default zero)."""
        u = np.asarray(u, dtype=float)
        x = np.zeros(self.order) if x0 is None else np.array(x0, dtype=float)
        for name, value, shape in (("u", u, (*u.shape[:1], len(self.inputs))), ("x0", x, (self.order,))):
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(
                    f"state_space.simulate.{name}: expected finite numbers of shape {shape}, got {shown(value)}"
                )
        forcing = u @ self.B.T
        states = np.empty((u.shape[0], self.order))
        for n in range(u.shape[0]):
            states[n] = x
            x = self.A @ x + forcing[n]
        return np.asarray(states @ self.C.T + u @ self.D.T)


class TransferFunction:
    """C (z - A)^-1 B + D, called with one z after another.

    The Schur form is computed once, so that each costs O(n^2).
    """

    def __init__(self, a: Array, b: Array, c: Array, d: Array) -> None:
        triangle, basis = scipy.linalg.schur(a, output="complex")
        self.poles = np.diag(triangle).copy()
        self._shifted = np.asfortranarray(-triangle)
        self._b, self._c, self._d = basis.conj().T @ b, c @ basis, d

    def __call__(self, z: complex) -> NDArray[np.complex128]:
        """Response (ny, nu)."""
        np.fill_diagonal(self._shifted, z - self.poles)
        state = scipy.linalg.solve_triangular(self._shifted, self._b, check_finite=False)
        return np.asarray(self._c @ state + self._d)


def delayed(system: StateSpace) -> StateSpace:
    """The same system whose inputs act one step late; each input becomes a state."""
    n, nu, ny = system.order, len(system.inputs), len(system.outputs)
    return replace(
        system,
        A=np.block([[system.A, system.B], [np.zeros((nu, n + nu))]]),
        B=np.vstack([np.zeros((n, nu)), np.eye(nu)]),
        C=np.hstack([system.C, system.D]),
        D=np.zeros((ny, nu)),
    )


def series(first: StateSpace, second: StateSpace) -> StateSpace:
    """Second driven by first: first's outputs are the inputs of second that bear the same names.

    Inputs of second that first does not provide stay inputs, after those of first. Outputs are second's.

    Raises
    ------
    ValueError
        If the time steps differ, or an output of first is no input of second.
    """
    require_time_step("series.second.time_step", second.time_step, first.time_step, "the first system's")
    driven = second.select(inputs=first.outputs)
    remaining = second.select(inputs=[name for name in second.inputs if name not in first.outputs])
    n1, n2 = first.order, second.order
    return StateSpace(
        A=np.block([[first.A, np.zeros((n1, n2))], [driven.B @ first.C, second.A]]),
        B=np.block([[first.B, np.zeros((n1, len(remaining.inputs)))], [driven.B @ first.D, remaining.B]]),
        C=np.hstack([driven.D @ first.C, second.C]),
        D=np.hstack([driven.D @ first.D, remaining.D]),
        time_step=first.time_step,
        inputs=first.inputs + remaining.inputs,
        outputs=second.outputs,
    )


def feedback(plant: StateSpace, law: StateSpace) -> StateSpace:
    """A plant under a law that answers some of its outputs by some of its inputs, by name, and never at once.

    What else is given on those inputs adds to the law's. Inputs are the plant's, outputs the plant's, then the law's;
    the law's states stand last.

    Raises
    ------
    ValueError
        If the law answers at once, or the time steps or the names do not go together.
    """
    require_time_step("feedback.law.time_step", law.time_step, plant.time_step, "the plant's")
    if law.D.any():
        raise ValueError("feedback.law.D: expected zeros, as the plant may answer at once, got others")
    seen, driven = plant.select(outputs=law.inputs), plant.select(inputs=law.outputs)
    answered = law.C
    return StateSpace(
        A=np.block(
            [
                [plant.A, driven.B @ answered],
                [law.B @ seen.C, law.A + law.B @ driven.select(outputs=law.inputs).D @ answered],
            ]
        ),
        B=np.vstack([plant.B, law.B @ seen.D]),
        C=np.block([[plant.C, driven.D @ answered], [np.zeros((len(law.outputs), plant.order)), answered]]),
        D=np.vstack([plant.D, np.zeros((len(law.outputs), len(plant.inputs)))]),
        time_step=plant.time_step,
        inputs=plant.inputs,
        outputs=(*plant.outputs, *law.outputs),
    )


def require_time_step(name: str, given: float, expected: float, whose: str) -> None:
    """Refuse a system that was sampled at another time step than the one it meets.

    Parameters
    ----------
    name : str
        Of the time step, for the message.
    given, expected : float
        [s]; they may differ by rounding.
    whose : str
        Whose time step is expected, for the message.
    """
    if not math.isclose(given, expected, rel_tol=SAME_STEP):
        raise ValueError(
            f"{name}: expected {number(expected)} s, {whose}, got {number(given)} s; sample it at the same step"
        )
