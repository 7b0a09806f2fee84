"""Generalised-alpha time marching of flexible bodies with large rotations and velocity constraints.

Bruels, Cardona and Arnold's scheme on rotation matrices: second order, no parameters of rotation, unconditionally
stable in the linear range. spectral_radius sets the damping at infinite frequency; one leaves energy alone in the
linear range, and with velocity constraints (index 2) less than one is needed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy.linalg

from flapgym.core.arrays import AnyArray
from flapgym.structure.beam import Configuration

MAX_ITERATIONS = 25
TOLERANCE = 1e-11


class MarchError(RuntimeError):
    """A time step did not converge; the message says when, how far off and what to try."""


@dataclass(frozen=True, eq=False)
class Motion:
    """State of a multibody system at one time [s].

    velocity, acceleration : (n,) rates of the unknowns; algorithmic : (n,) the scheme's own acceleration;
    multipliers : (k,).
    """

    time: float
    configuration: tuple[Configuration, ...]
    velocity: AnyArray
    acceleration: AnyArray
    algorithmic: AnyArray
    multipliers: AnyArray


class System(Protocol):
    """What can be marched: n unknowns of motion and k constraints on their velocities."""

    def moved(
        self, configuration: tuple[Configuration, ...], increment: AnyArray
    ) -> tuple[Configuration, ...]:
        """Return the configuration after an increment (n,) of the unknowns."""

    def residual(self, motion: Motion) -> AnyArray:
        """Return imbalance of forces (n,) and violation of the velocity constraints (k,)."""

    def iteration_matrix(self, motion: Motion, rate_factor: float, mass_factor: float) -> AnyArray:
        """Return the residual's derivative (n + k, n + k).

        For increments of the unknowns that move velocities by rate_factor and accelerations by mass_factor as
        much, and for the multipliers.
        """


def start(
    configuration: tuple[Configuration, ...], velocity: AnyArray, constraints: int = 0, time: float = 0.0
) -> Motion:
    """First state without acceleration, as in a steady state or where loads begin smoothly."""
    still = np.zeros_like(velocity)
    return Motion(time, configuration, velocity, still, still, np.zeros(constraints))


def march(
    system: System, motion: Motion, time_step: float, steps: int, spectral_radius: float = 0.9
) -> list[Motion]:
    """States at `steps` + 1 times from `motion` on.

    Raises
    ------
    MarchError
        If a step does not converge.
    """
    if not (time_step > 0.0 and 0.0 <= spectral_radius <= 1.0):
        raise ValueError(
            f"march: expected time_step > 0 and spectral_radius from 0 to 1, got {time_step} and {spectral_radius}"
        )
    states = [motion]
    for _ in range(steps):
        states.append(_step(system, states[-1], time_step, spectral_radius))
    return states


def _step(system: System, old: Motion, h: float, radius: float) -> Motion:
    alpha_m, alpha_f = (2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0)
    gamma = 0.5 + alpha_f - alpha_m
    beta = 0.25 * (gamma + 0.5) ** 2
    rate_factor, mass_factor = gamma / (beta * h), (1.0 - alpha_m) / (beta * h * h * (1.0 - alpha_f))

    # First guess: the true acceleration stays.
    algorithmic = (old.acceleration - alpha_m * old.algorithmic) / (1.0 - alpha_m)
    advance = h * old.velocity + h * h * ((0.5 - beta) * old.algorithmic + beta * algorithmic)
    new = Motion(
        time=old.time + h,
        configuration=system.moved(old.configuration, advance),
        velocity=old.velocity + h * ((1.0 - gamma) * old.algorithmic + gamma * algorithmic),
        acceleration=old.acceleration,
        algorithmic=algorithmic,
        multipliers=old.multipliers,
    )
    size, factors, largest = len(new.velocity), None, np.inf
    for iteration in range(MAX_ITERATIONS):
        if iteration % 6 == 0:
            factors = scipy.linalg.lu_factor(system.iteration_matrix(new, rate_factor, mass_factor))
        correction = -scipy.linalg.lu_solve(factors, system.residual(new))
        moved, pushed = correction[:size], correction[size:]
        advance = advance + moved
        new = replace(
            new,
            configuration=system.moved(old.configuration, advance),
            velocity=new.velocity + rate_factor * moved,
            acceleration=new.acceleration + mass_factor * moved,
            algorithmic=new.algorithmic + moved / (beta * h * h),
            multipliers=new.multipliers + pushed,
        )
        largest = float(np.abs(moved).max())
        if largest < TOLERANCE * max(1.0, float(np.abs(advance).max())):
            return new
        if not np.isfinite(largest):
            break
    raise MarchError(
        f"march: the step to {new.time:.6g} s did not converge, last correction {largest:.3g} m (rad); "
        "try a smaller time step"
    )
