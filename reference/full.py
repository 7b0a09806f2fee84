"""The turbine with every state, marched in time: what the reduced models are held to. Nothing in production uses it.

Every bound and wake circulation is a state (12,570 for the paper's lattice), the joint follows the azimuth, and
all modes given are kept. Structure and lattice are solved together at each step, as in eq. 8, 9 and 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flapgym.aerodynamics import Aerodynamics, RotorWake
from flapgym.aeroelastic.build import slow_wake
from flapgym.aeroelastic.coupling import (
    Equations,
    Instant,
    LatticeInput,
    explicit_part,
    implicit_part,
    instant,
    reading,
)
from flapgym.aeroelastic.equations import Parts
from flapgym.core.arrays import BLADES, Array
from flapgym.core.multiblade import on_rotor, to_blades
from flapgym.model.signals import COMPONENTS, EACH_BLADE, grouped
from flapgym.reduction import ReducedSystem
from reference.by_azimuth import equations_by_azimuth, inputs_by_azimuth


def march_turbine(parts: Parts, rotor: Aerodynamics, u: Array, azimuth: float) -> Array:
    """Outputs (T, 13), ``by_azimuth.OUTPUTS``, for inputs u (T, nu), ``inputs_by_azimuth``, from rest.

    Flap and gust act at once, and at the step they happen (the case's ``gust`` and ``input_delay`` do not enter).

    Parameters
    ----------
    parts : Parts
        Structure in the modes to keep, and one blade's lattice in them.
    rotor : Aerodynamics
        The lattice of all blades the parts were made with.
    u : (T, nu) float
        Flap angles [rad] and rates [rad/s] of the blades, homogeneous wind [m/s]; where the case has them, the wind in
        each strip of each blade, and gravity [m/s^2].
    azimuth : float
        Of blade 1 at the first step [rad].

    Notes
    -----
    Cost: about 5 ms a step with 13 modes a blade on an idle core, mostly the wake's product; some 12 ms with winds by
    strip.
    """
    equations, dt = equations_by_azimuth(parts), parts.case.discretisation.time_step
    lattice, wake = parts.lattice, RotorWake(rotor)
    each = np.eye(BLADES)
    # The lattice speaks in components on the rotor, the march in blades.
    to_blades = np.kron(on_rotor(), np.eye(lattice.downwash.shape[1]))
    to_components = np.kron(np.linalg.inv(on_rotor()), np.eye(lattice.load.shape[0]))
    downwash = np.kron(each, lattice.downwash) @ to_blades
    loads = [to_components @ np.kron(each, lattice.load @ force) for force in rotor.force]
    direct, in_wake = np.zeros((loads[0].shape[0], downwash.shape[1])), None
    if (full := lattice.full) is not None:
        in_velocity = to_components @ np.kron(each, full.induced)
        loads[0] = loads[0] + to_components @ np.kron(each, full.circulation) + in_velocity @ wake.leading[0]
        direct = to_components @ np.kron(each, full.direct) @ to_blades
        in_wake = in_velocity
    outputs, inputs = loads[0].shape[0], downwash.shape[1]
    # At a step the load is that of the step's own inputs and one already known from the wake and the past.
    empty = np.zeros((0, 0))
    memoryless = ReducedSystem(
        empty,
        np.zeros((0, inputs + outputs)),
        np.zeros((outputs, 0)),
        np.hstack([loads[0] @ wake.per_downwash @ downwash + direct, np.eye(outputs)]),
        np.ones(0),
    )

    def at(step: int) -> Equations:
        return _with_known_load(equations(azimuth + parts.case.rotor_speed * dt * step), outputs)

    past = [np.zeros(wake.per_downwash.shape[0]) for _ in loads[1:]]
    x = np.zeros(2 * equations(0.0).structure.mass.shape[0])
    y = np.empty((len(u), len(equations(0.0).outputs)))
    before: tuple[Instant, Array] | None = None
    for n, now in enumerate(u):
        free = wake.from_wake()
        known = loads[0] @ free + sum(load @ gamma for load, gamma in zip(loads[1:], past, strict=True))
        if in_wake is not None:
            known = known + in_wake @ wake.leading_from_wake()
        e = np.concatenate([now, known])
        there = at(n)
        after = instant(there, memoryless)
        if before is not None:
            right, start = explicit_part(before[0], dt)
            left, end = implicit_part(after, dt)
            x = np.linalg.solve(left, right @ x + start @ before[1] + end @ e)
        C, D = reading(there.output, after)
        y[n] = C @ x + D @ e
        asks = there.lattice_input
        s = np.hstack([asks.position, asks.velocity]) @ x + asks.exogenous @ e
        gamma = free + wake.per_downwash @ (downwash @ s[:inputs])
        wake.advance(gamma)
        past = [gamma, *past[:-1]]
        before = after, e
    return y


def _with_known_load(equations: Equations, count: int) -> Equations:
    """The same equations with `count` loads of the lattice as further inputs."""
    asks, output, forcing = equations.lattice_input, equations.output, equations.forcing
    assert output.direct is not None
    assert forcing is not None
    inputs = asks.exogenous.shape[1]
    none = np.zeros((count, asks.position.shape[1]))
    return Equations(
        equations.structure,
        LatticeInput(
            position=np.vstack([asks.position, none]),
            velocity=np.vstack([asks.velocity, none]),
            exogenous=np.block(
                [
                    [asks.exogenous, np.zeros((asks.exogenous.shape[0], count))],
                    [np.zeros((count, inputs)), np.eye(count)],
                ]
            ),
        ),
        replace(output, direct=np.hstack([output.direct, np.zeros((len(output.direct), count))])),
        equations.inputs,
        equations.outputs,
        np.hstack([forcing, np.zeros((len(forcing), count))]),
    )


def march_model_inputs(parts: Parts, rotor: Aerodynamics, u: Array, azimuth: float) -> Array:
    """Outputs (T, 13), ``by_azimuth.OUTPUTS``, for the inputs u (T, nu) of the turbine's model, ``Parts.inputs``.

    The states of a moving wake stand before the lattice, marched or reduced, as they do in the model. Pitch is left
    out.
    """
    theta = azimuth + parts.case.rotor_speed * rotor.time_step * np.arange(len(u), dtype=np.float64)
    felt = told_by_blade(parts.inputs, slow_wake(parts).simulate(u), theta)
    return march_turbine(
        parts, rotor, np.stack([felt[name] for name in inputs_by_azimuth(parts)], axis=1), azimuth
    )


def told_by_blade(names: Sequence[str], signals: Array, azimuth: Array) -> dict[str, Array]:
    """Signals (T, n) in multi-blade components blade by blade, each (T,) by name, at azimuths (T,) [rad]."""
    told: dict[str, Array] = {}
    for base, of_blades in grouped(names):
        if of_blades:
            first = names.index(f"{base}_{COMPONENTS[0]}")
            each = to_blades(signals[:, first : first + BLADES], azimuth)
            told |= {f"{base}_{number}": each[:, b] for b, number in enumerate(EACH_BLADE)}
        else:
            told[base] = signals[:, names.index(base)]
    return told
