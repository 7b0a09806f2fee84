"""One blade's lattice as the structure sees it, and its reduction by cyclic component (Section II.D)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flapgym.aerodynamics import (
    Aerodynamics,
    FullLoads,
    MeanFlow,
    cambered,
    flap_downwash,
    full_loads,
    gust_arrival,
    gust_downwash,
    transfer_function,
)
from flapgym.aeroelastic.interaction import (
    displacement_downwash,
    following_moments,
    hub_turn_downwash,
    interpolation,
    velocity_downwash,
)
from flapgym.aeroelastic.lattice_motion import lattice_motion, mode_downwash, segment_motion
from flapgym.aeroelastic.stations import cuts
from flapgym.core.arrays import Array
from flapgym.core.wording import number
from flapgym.reduction import ReducedSystem, balanced_reduction
from flapgym.structure import LinearBlade
from flapgym.structure.rotation import rigid_displacement
from flapgym.turbine import Case, Flap

_MOST_ROWS = 4096
_SCALING_FREQUENCY = 0.2  # Hz; lattice outputs count by their size here, where turbulence has its energy


@dataclass(frozen=True, eq=False)
class BladeLattice:
    """One blade's lattice as the structure sees it: named inputs to downwash, Gamma's forces to loads.

    Attributes
    ----------
    downwash : (p, 2 m + 8 + 2 flaps + strips) float
        Downwash at the collocation points per unit input: mode rates (m), modes (m), hub velocity (6), hub
        rotation about y and z (2), flap angles, flap rates, gust in each spanwise strip.
    load : (m + 6 + k, 3 P) float
        Generalised force on the modes, force and moment on the hub apex, and what the panels add to the moments at the
        k stations that the case asks for, per unit panel force.
    modes, flaps, strips : int
        m and the numbers of flaps and of strips.
    convected : bool
        Whether the reduced lattice's gust travels along the chord; ``downwash`` has it strike at once.
    full : FullLoads, optional
        What the mean circulation in the perturbed flow adds to the loads. None leaves the forces of the perturbed
        circulation in the mean flow, as in the paper: some 3 % of the flapwise moment by gust is lost, but 40 % of the
        torque.
        A convected gust still meets the mean circulation at once.
    """

    downwash: Array
    load: Array
    modes: int
    flaps: int
    strips: int
    convected: bool = False
    full: FullLoads | None = None

    def select(self, *names: str) -> Array:
        """Columns of the identity that feed the named group of inputs, shape (nu, size of the group)."""
        m = self.modes
        bounds = np.cumsum([0, m, m, 6, 2, self.flaps, self.flaps, self.strips])
        groups = ("mode_rate", "mode", "hub_velocity", "hub_turn", "flap_angle", "flap_rate", "gust")
        eye = np.eye(bounds[-1])
        return np.hstack([eye[:, bounds[i] : bounds[i + 1]] for i in map(groups.index, names)])

    @property
    def on_structure(self) -> Array:
        """Which of the loads act on the structure, (m + 6, m + 6 + k): those at stations are there to be told alone."""
        return np.eye(self.modes + 6, len(self.load))

    @property
    def motion_inputs(self) -> tuple[Array, Array]:
        """Inputs per held position and per rate of the modes and the hub motion (u, phi), each (nu, m + 6)."""
        unfelt = np.zeros((self.downwash.shape[1], 4))  # translations, and turning about the shaft
        by_position = np.hstack([self.select("mode"), unfelt, self.select("hub_turn")])
        return by_position, self.select("mode_rate", "hub_velocity")


def blade_lattice(
    case: Case, aero: Aerodynamics, blade: LinearBlade, shape: Array, flow: MeanFlow | None = None
) -> BladeLattice:
    """Inputs and outputs of one blade's lattice in the blade's modes ``shape`` (6 n, m), linearised about a mean flow.

    Without a mean flow, or where the case asks for no more, the loads are those of the perturbed circulation alone, and
    the sections' camber enters the mean load only.
    """
    force_displacement, _ = interpolation(blade, aero.force_point)
    virtual = np.array([cut.work for cut in cuts(case, blade)]).reshape(-1, len(shape)).T
    load = np.vstack([(force_displacement @ shape).T, rigid_displacement(aero.force_point).T])
    if virtual.size:
        load = np.vstack([load, (force_displacement @ virtual).T])
    modes, sizes = shape.shape[1], (shape.shape[1], len(case.flaps), aero.lattice.strips)
    convected = case.discretisation.gust == "convected"
    if flow is None or case.airloads.linearisation == "mean flow":
        displacement, rotation = (part @ shape for part in interpolation(blade, aero.collocation))
        rate = velocity_downwash(aero, displacement)
        by_position = displacement_downwash(aero, case.rotor_speed, displacement, rotation)
        return BladeLattice(_downwash(case, aero, rate, by_position), load, *sizes, convected)
    aero = cambered(aero, flow.loads.zero_lift_angle)
    motion = lattice_motion(case, blade, shape, flow)
    full = full_loads(aero, flow, segment_motion(case, aero, motion), load)
    direct = full.direct.copy()
    direct[:, modes : 2 * modes] += following_moments(blade, flow.loads, shape, virtual)
    full = replace(full, direct=direct)
    downwash = _downwash(case, aero, *mode_downwash(aero, case.rotor_speed, motion))
    return BladeLattice(downwash, load, *sizes, convected, full)


def _downwash(case: Case, aero: Aerodynamics, rate: Array, by_position: Array) -> Array:
    """Columns of ``BladeLattice.downwash``, those of the modes' rates and of the modes held being given."""
    flaps = [_flap_downwash(aero, case, flap) for flap in case.flaps]
    angles, rates = (np.stack(part, axis=1) for part in zip(*flaps, strict=True))
    hub = velocity_downwash(aero, rigid_displacement(aero.collocation))
    hub_turn = hub_turn_downwash(aero, case.operating_point.wind_speed)[
        :, 1:
    ]  # about the shaft nothing changes
    return np.hstack([rate, by_position, hub, hub_turn, angles, rates, gust_downwash(aero)])


def _flap_downwash(aero: Aerodynamics, case: Case, flap: Flap) -> tuple[Array, Array]:
    """Downwash (n,) per angle and per rate of a flap; refuses one that the lattice does not see."""
    angle, rate = flap_downwash(aero, flap)
    if not (np.isfinite(angle).all() and angle.any()):
        place = f"[{case.flaps.index(flap)}]" if len(case.flaps) > 1 else ""
        raise ValueError(
            f"flap{place}: the lattice resolves no flap from span_start {number(flap.span_start)} to span_end "
            f"{number(flap.span_end)} of chord_fraction {number(flap.chord_fraction)}; make it larger"
        )
    return angle, rate


def lattice_response(
    aero: Aerodynamics, lattice: BladeLattice, component: int, z: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Loads per input (nz, m + 6, nu) of one cyclic component at points z, with the lattice's own kind of gust."""
    downwash: NDArray[np.generic] = lattice.downwash
    if lattice.convected:
        by_frequency = np.broadcast_to(downwash, (len(z), *downwash.shape)).astype(complex)
        by_frequency[:, :, -lattice.strips :] *= gust_arrival(aero, z)[:, :, None]
        downwash = by_frequency
    return transfer_function(aero, component, z, downwash, lattice.load, lattice.full)


def reduce_component(
    aero: Aerodynamics, lattice: BladeLattice, component: int, order: int, tolerance: float = 0.0
) -> ReducedSystem:
    """Balanced reduction of one cyclic component of the lattice, scaled to comparable inputs and outputs.

    ``order`` is the most states to keep; those whose singular value is below ``tolerance`` of the largest go too.

    Raises
    ------
    ValueError
        If the wake has more than 4096 rows, which would take some 10 GB, or the reduction fails.
    """
    return reduce_stacked(aero, [lattice], component, order, tolerance)


def reduce_stacked(
    aero: Aerodynamics, lattices: Sequence[BladeLattice], component: int, order: int, tolerance: float = 0.0
) -> ReducedSystem:
    """Like ``reduce_component`` where blades bring lattices of their own: one after the other in inputs and outputs."""
    if aero.wake_rows > _MOST_ROWS:
        raise ValueError(
            f"discretisation.wake_length: {aero.wake_rows} wake rows, the reduction takes at most {_MOST_ROWS}; "
            "shorten the wake or raise time_step"
        )
    # The impulse response lasts somewhat longer than the wake: four times that leaves nothing to fold back.
    frequencies = max(2048, 2 ** int(np.ceil(np.log2(4 * aero.wake_rows))))
    z = np.exp(2j * np.pi * np.arange(frequencies) / frequencies)
    response = _stacked_response(aero, lattices, component, z)
    downwash = np.hstack([lattice.downwash for lattice in lattices])
    input_scale = 1.0 / np.sqrt((downwash**2).mean(axis=0))
    at = round(_SCALING_FREQUENCY * aero.time_step * frequencies)
    output_scale = np.sqrt((np.abs(response[at] * input_scale) ** 2).mean(axis=1))
    return balanced_reduction(
        response,
        order,
        input_scale,
        output_scale,
        real=component == 0,
        tolerance=tolerance,
        block_rows=max(500, int(1.2 * aero.wake_rows)),
    )


def reduction_error(
    aero: Aerodynamics, lattices: Sequence[BladeLattice], component: int, reduced: ReducedSystem
) -> float:
    """Largest error of the reduced lattice's response below 2 Hz, over the size of the response at that frequency.

    Responses as matrices (Frobenius norm), each input and output scaled to unit size at 0.2 Hz.
    """
    frequency = np.append(_SCALING_FREQUENCY, np.geomspace(0.02, 2.0, 12))
    z = np.exp(2j * np.pi * frequency * aero.time_step)
    exact = _stacked_response(aero, lattices, component, z)
    size = np.abs(exact[0])
    inputs = size.max(axis=0)
    size = np.maximum((size / inputs).max(axis=1)[:, None] * inputs, np.finfo(float).tiny)
    error, whole = (reduced.transfer_function(z) - exact) / size, exact / size
    return float((np.linalg.norm(error, axis=(1, 2)) / np.linalg.norm(whole, axis=(1, 2))).max())


def _stacked_response(
    aero: Aerodynamics, lattices: Sequence[BladeLattice], component: int, z: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    load = np.vstack([lattice.load for lattice in lattices])
    return np.concatenate(
        [
            lattice_response(
                aero, replace(lattice, load=load, full=_stacked_full(lattices, place)), component, z
            )
            for place, lattice in enumerate(lattices)
        ],
        axis=2,
    )


def _stacked_full(lattices: Sequence[BladeLattice], driven: int) -> FullLoads | None:
    """Full loads of stacked lattices when the inputs of one are driven: the others move neither air nor segments."""
    parts = [lattice.full for lattice in lattices]
    if any(part is None for part in parts):
        return None
    given = [part for part in parts if part is not None]
    return FullLoads(
        circulation=np.vstack([part.circulation for part in given]),
        induced=np.vstack([part.induced for part in given]),
        direct=np.vstack(
            [
                part.direct if place == driven else np.zeros_like(part.direct)
                for place, part in enumerate(given)
            ]
        ),
    )
