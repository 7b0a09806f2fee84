"""The turbine by azimuth with what a site adds: weight, edgewise moments, what the ground takes up.

The product has these in multi-blade coordinates alone (`flapgym.aeroelastic.equations`). Here every blade keeps its own
frame, in which its weight turns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np

from flapgym.aeroelastic.coupling import Equations, Output
from flapgym.aeroelastic.equations import (
    Parts,
    edgewise,
    modal_blade_matrices,
    periodic_equations,
    rigid_turns,
    root_moment,
)
from flapgym.aeroelastic.stations import FLAPWISE
from flapgym.core.arrays import BLADES, Array
from flapgym.core.multiblade import blade_azimuths, on_rotor
from flapgym.model.signals import EACH_BLADE, GRAVITY, turbine_inputs, turbine_outputs
from flapgym.structure.rotation import about_x, hat

OUTPUTS = turbine_outputs(
    (("rbm_edge", True), ("tower_base_fore_aft", False), ("tower_top_acceleration_fore_aft", False)),
    EACH_BLADE,
)
_SHAFT = np.array([1.0, 0.0, 0.0])


def inputs_by_azimuth(parts: Parts) -> tuple[str, ...]:
    """Flaps, homogeneous wind, and what the case asks for: winds by strip, gravity. Pitch is no input here."""
    return turbine_inputs(parts.lattice.flaps, parts.strips, EACH_BLADE, gravity=parts.case.signals.gravity)


def equations_by_azimuth(parts: Parts) -> Callable[[float], Equations]:
    """Equations of motion by azimuth [rad] in (a_1, a_2, a_3, x_t), the modes of the blades and of the support.

    Inputs are those of `inputs_by_azimuth`, outputs `OUTPUTS`.
    """
    light, own = periodic_equations(parts), modal_blade_matrices(parts)
    support, shape = parts.support, parts.modal_support[1]
    inputs, modes = inputs_by_azimuth(parts), parts.lattice.modes
    of_support = slice(BLADES * modes, None)
    size, loads = BLADES * modes + shape.shape[1], BLADES * (modes + 6)
    own_weight = np.zeros((len(support.weight), len(inputs)))
    if GRAVITY in inputs:
        own_weight[:, inputs.index(GRAVITY)] = support.weight
    turns = rigid_turns(support)[:, :1]  # over downwind
    flapwise, edge = (
        _each(root_moment(parts.blade, modes, axis)) for axis in (FLAPWISE, edgewise(parts.case))
    )
    top = np.zeros((1, size))
    top[:, of_support] = (support.tower_top @ shape)[:1]

    def at(azimuth: float) -> Equations:
        known, of_blades = light(azimuth), _blade_loads(parts, own, azimuth)
        # What the blades pull at the support's foot, less what the inertia between resists with.
        base = _taken(_on_blades(parts, turns, azimuth).T, of_blades)
        base.acceleration[:, of_support] -= turns.T @ support.mass @ shape
        base.velocity[:, of_support] -= turns.T @ support.damping @ shape
        base.direct[:] += turns.T @ own_weight
        places = _taken(np.zeros((BLADES + 2, loads)), of_blades)  # of the tips and the tower's top: no loads
        places.position[:] = known.output.position[BLADES:]
        acceleration = _taken(np.zeros((1, loads)), of_blades)
        acceleration.acceleration[:] = top
        told = (
            _taken(flapwise, of_blades),
            places,
            _taken(edge, of_blades),
            base,
            acceleration,
        )
        forcing = np.zeros((size, len(inputs)))
        forcing[: BLADES * modes] = _each(np.eye(modes, modes + 6)) @ of_blades.direct
        forcing[of_support] = _on_blades(parts, shape, azimuth).T @ of_blades.direct + shape.T @ own_weight
        asks = known.lattice_input
        exogenous = np.zeros((len(asks.exogenous), len(inputs)))
        exogenous[:, : len(known.inputs)] = asks.exogenous
        return Equations(
            known.structure,
            replace(asks, exogenous=exogenous),
            Output(*(np.vstack([getattr(part, f.name) for part in told]) for f in fields(Output))),
            inputs,
            OUTPUTS,
            forcing,
        )

    return at


@dataclass(frozen=True, eq=False)
class _Loads(Output):
    """Outputs to which inputs always have their own share."""

    direct: Array


def _blade_loads(parts: Parts, own: tuple[Array, Array, Array], azimuth: float) -> _Loads:
    """Loads (3 (m + 6)) on each blade's modes and hub, in its frame: air and weight less what motion resists with.

    ``own`` are ``modal_blade_matrices``.
    """
    inputs, modes = inputs_by_azimuth(parts), parts.lattice.modes
    mass, damping, stiffness = own
    hubs = _on_blades(parts, parts.modal_support[1], azimuth)
    T = np.hstack([_each(np.eye(modes + 6, modes)), hubs])
    # What stands turns backwards in a blade's frame.
    spin = np.zeros((modes + 6, modes + 6))
    spin[modes:, modes:] = -parts.case.rotor_speed * np.kron(np.eye(2), hat(_SHAFT))
    turning = np.hstack([np.zeros((len(T), BLADES * modes)), _each(spin) @ hubs])
    weight = np.zeros((len(T), len(inputs)))
    if GRAVITY in inputs:
        down = parts.support.shaft_axes.T @ [0.0, 0.0, -1.0]
        # A blade weighs on its modes and on its hub what it would resist a falling hub with.
        weight[:, inputs.index(GRAVITY)] = np.concatenate(
            [mass[:, modes : modes + 3] @ about_x(angle).T @ down for angle in blade_azimuths(azimuth)]
        )
    return _Loads(
        acceleration=-_each(mass) @ T,
        velocity=-_each(damping) @ T - _each(mass) @ turning,
        position=-_each(stiffness) @ T,
        load=np.asarray(np.kron(on_rotor(), parts.lattice.on_structure)),
        direct=weight,
    )


def _each(part: Array) -> Array:
    """The same for each of the blades."""
    return np.asarray(np.kron(np.eye(BLADES), part))


def _on_blades(parts: Parts, motion: Array, azimuth: float) -> Array:
    """Modes (none) and hub of each blade (3 (m + 6), n), in its frame, as the support moves by (N, n)."""
    hub, still = parts.support.hub @ motion, np.zeros((parts.lattice.modes, motion.shape[1]))
    frames = [np.kron(np.eye(2), about_x(angle).T) for angle in blade_azimuths(azimuth)]
    return np.vstack([np.vstack([still, frame @ hub]) for frame in frames])


def _taken(rows: Array, loads: _Loads) -> _Loads:
    """Rows (k, n) of n loads."""
    return _Loads(*(rows @ getattr(loads, f.name) for f in fields(Output)))
