"""The wake's answer to slow inputs: a wake that moves, and the states that stand for it.

The lattice's wake keeps to a fixed helix, cut a quarter diameter behind the rotor. When the wind rises a real wake
moves faster: the vortices of the mean circulation stand farther apart and induce less, which the fixed helix leaves
out; the rest of a long wake induces more, which the cut leaves out. Here a long wake that moves is linearised in how
far its rows are displaced, and what it has over the short one becomes one state on the wind.

Pitch changes the whole rotor's thrust and with it the induction that slows the wake: less thrust, a faster wake, which
induces less still. That, too, becomes one state, which stands for the velocity that the rotor then meets.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from flapgym.aerodynamics.biot_savart import ring_influence
from flapgym.aerodynamics.downwash import flap_downwash, gust_downwash
from flapgym.aerodynamics.lattice import wake_ages, wake_nodes
from flapgym.aerodynamics.linearisation import MeanFlow
from flapgym.aerodynamics.loads import leading_segments
from flapgym.aerodynamics.model import Aerodynamics, blade_turns
from flapgym.aerodynamics.response import collective_response
from flapgym.aerodynamics.rotor import build_aerodynamics, root_moment_load, thrust_load, wake_rows
from flapgym.aerodynamics.steady import momentum_slope, pitch_downwash, spin_downwash
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace
from flapgym.turbine import Case

_SHIFT = 1e-4  # of the way a row travels in a step: how far corners are moved to difference the influence


@dataclass(frozen=True)
class WakeState:
    """Effective input u + gain x with time_constant x' = u - x: what a fixed, short wake leaves out of a slow input.

    Attributes
    ----------
    gain : float
        What a steady input gains.
    time_constant : float
        [s]
    misfit : float
        Largest difference of the fitted step response from the wanted one, over the latter's end.
    """

    gain: float
    time_constant: float
    misfit: float

    def state_space(self, time_step: float, name: str) -> StateSpace:
        """One state from the input of a name to the effective one, exact where it is linear between steps.

        The input's part at the end of a step is moved into the state, as in the coupled model.
        """
        ratio = time_step / self.time_constant
        decay = np.exp(-ratio)
        ahead = 1.0 - (1.0 - decay) / ratio
        return StateSpace(
            A=np.array([[decay]]),
            B=np.array([[1.0 - decay - ahead + decay * ahead]]),
            C=np.array([[self.gain]]),
            D=np.array([[1.0 + self.gain * ahead]]),
            time_step=time_step,
            inputs=(name,),
            outputs=(name,),
        )


@dataclass(frozen=True)
class WakeTransport:
    """The states of a rotor's wake, for the collective part of its inputs.

    Of the loads it is the root moment that was fitted. Blade motion has no state: what moves the rotor along the shaft
    is wind to it, and leaving that out costs some 2 % of the tower's aerodynamic damping.

    Attributes
    ----------
    wind : WakeState
        For wind that is the same over rotor and wake at one time; one that travels with the air has a longer lag. A
        gust of a tenth of the wind, up or down, changes the moving wake's own response by 0.5 %.
    flaps : tuple of WakeState
        For each flap of the case, alike on all blades. They do not carry the wake: a longer one only takes from slow
        angles what the cut left.
    """

    wind: WakeState
    flaps: tuple[WakeState, ...]


def displaced_wake_downwash(aero: Aerodynamics, circulation: ArrayLike, *, turned: bool = False) -> Array:
    """Downwash (n, K + 1) [m/s per m] by which each row of wake corners, moved downwind on all blades, acts on a blade.

    Parameters
    ----------
    circulation : (strips,) float
        Steady circulation that each strip sheds [m^2/s].
    turned : bool
        Whether the rows are left behind by the rotor in place of moved downwind [m/s per rad].
    """
    shed = np.asarray(circulation, dtype=float)
    wake = wake_nodes(aero.lattice, aero.inflow, aero.wake_age)
    # The last bound ring goes first: its rear is the first row of corners and must move with it.
    node = np.concatenate([aero.lattice.node[-2:-1], wake])
    ring = np.arange(len(node) - 1)
    travel = aero.inflow.rotor_speed if turned else aero.inflow.wake_velocity[0]
    shift = _SHIFT * travel * aero.time_step
    move = aero.inflow.per_rotor_speed(node) if turned else np.broadcast_to([1.0, 0.0, 0.0], node.shape)
    downwash = np.zeros((aero.collocation.shape[0], len(node)))
    for parity in (0, 1):  # every other row of corners at once: a ring feels one of its two rows move
        moved = np.where(ring % 2 == parity, ring, ring + 1)
        for side in (-1.0, 1.0):
            corners = node.copy()
            corners[parity::2] += side * shift * move[parity::2]
            felt = _all_blades(aero, corners) @ shed
            np.add.at(downwash.T, moved, side / (2.0 * shift) * felt.T)
    return downwash[:, 1:]


def _all_blades(aero: Aerodynamics, node: Array) -> Array:
    """Normal velocity (n, rings, strips) of rings that all blades carry alike."""
    influence = (
        ring_influence(aero.collocation, aero.normal, node @ turn) for turn in blade_turns(aero.blades)
    )
    return np.asarray(sum(influence))


def wake_displacement(wind: ArrayLike, time_step: float, rows: int) -> Array:
    """How far the wind (T,) [m/s], none before, has carried each row of corners, shape (T, rows + 1) [m].

    A row of an age is carried by the wind since it was shed.
    """
    travelled = cumulative_trapezoid(np.asarray(wind, dtype=float), dx=time_step, initial=0.0)
    time = np.arange(len(travelled)) * time_step
    return travelled[:, None] - np.interp(time[:, None] - wake_ages(time_step, rows), time, travelled)


def moving_wake_response(
    aero: Aerodynamics, circulation: ArrayLike, wind: ArrayLike, load: ArrayLike
) -> Array:
    """Loads (T, ny) in time, from rest, under a homogeneous gust that also carries the wake along.

    Linear in the gust, about a steady circulation; the loads are those of the perturbed circulation in the mean flow.

    Parameters
    ----------
    circulation : (strips,) float
        Mean circulation that each strip sheds [m^2/s].
    wind : (T,) float
        Gust along the shaft at every time step [m/s].
    load : (ny, 3 P) float
        As in `collective_response`.
    """
    wind = np.asarray(wind, dtype=float)
    carried = wake_displacement(wind, aero.time_step, aero.wake_rows)
    struck = wind[:, None] * gust_downwash(aero).sum(axis=1)
    downwash = struck + carried @ displaced_wake_downwash(aero, circulation).T
    return collective_response(aero, downwash, np.eye(downwash.shape[1]), load)


def travelling_displacement(velocity: ArrayLike, time_step: float, rows: int) -> Array:
    """How far each row of corners has been carried, (T, rows + 1) [m], that keeps the velocity it was shed with.

    ``velocity`` (T,) [m/s], none before.
    """
    velocity, age = np.asarray(velocity, dtype=float), wake_ages(time_step, rows)
    time = np.arange(len(velocity)) * time_step
    # A step before the first the air still had none: between the two it rises like between all others.
    sampled = np.append(-time_step, time), np.append(0.0, velocity)
    return np.asarray(age * np.interp(time[:, None] - age, *sampled))


def adapting_wake_response(
    aero: Aerodynamics,
    circulation: ArrayLike,
    signal: ArrayLike,
    downwash: ArrayLike,
    load: ArrayLike,
    direct: ArrayLike,
    slowing: float,
    wound: ArrayLike | None = None,
) -> Array:
    """Loads (T, ny) in time, from rest, under downwash that follows a signal, in a wake that the loads themselves slow.

    What slows a row is the induction of the vortices around it, which were shed with it and travel along: it keeps the
    velocity with which it was shed. Linear, about a steady circulation.

    Parameters
    ----------
    circulation : (strips,) float
        Mean circulation that each strip sheds [m^2/s].
    signal : (T,) float
        Of the downwash at every time step.
    downwash : (n,) float
        On every blade, per unit of the signal [m/s].
    load : (ny, 3 P) float
        As in `collective_response`.
    direct : (ny,) float
        Loads per unit of the signal, at once.
    slowing : float
        By how much a unit of the first load slows the air that is being shed [m/s].
    wound : (n, K + 1) float, optional
        Downwash of each row of the wake per radian that the rotor leaves it behind, where the signal is the rotor's
        speed (`displaced_wake_downwash`) [m/s per rad].
    """
    signal, downwash = np.asarray(signal, dtype=float), np.asarray(downwash, dtype=float)
    still = collective_response(aero, signal[:, None], downwash[:, None], load)
    still = still + signal[:, None] * np.asarray(direct, dtype=float)
    if wound is not None:
        behind = wake_displacement(signal, aero.time_step, aero.wake_rows) @ np.asarray(wound, dtype=float).T
        still = still + collective_response(aero, behind, np.eye(behind.shape[1]), load)
    carried = travelling_displacement(np.ones(len(signal)), aero.time_step, aero.wake_rows)
    moved = carried @ displaced_wake_downwash(aero, circulation).T
    by_step = collective_response(aero, moved, np.eye(moved.shape[1]), load)
    impulse = np.diff(by_step, axis=0, prepend=0.0)  # of rows that one step alone sheds faster
    # The first load follows from its own past: f = still - slowing (impulse * f), a convolution.
    feedback = slowing * impulse[:, 0]
    feedback[0] += 1.0
    velocity = -slowing * lfilter([1.0], feedback, still[:, 0])
    return np.asarray(still + np.stack([lfilter(each, [1.0], velocity) for each in impulse.T], axis=-1))


def march_case(case: Case, wake_length: float, panels: int = 3) -> Case:
    """The case with a wake of another length and, at the same ratio of row to panel, no more than so many panels."""
    grid = case.discretisation
    panels = min(grid.chordwise_panels, panels)
    step = grid.time_step * grid.chordwise_panels / panels
    coarse = replace(grid, chordwise_panels=panels, time_step=step, wake_length=wake_length)
    return replace(case, discretisation=coarse)


def fitted_state(
    given: Array, wanted: Array, time_step: float, first: int, felt: Array | None = None
) -> WakeState:
    """The state before a system of step response `given` (T,) that comes nearest to `wanted` from step `first` on.

    The state's own step is felt as `felt` (T,) where it does not come in by the same input.
    """
    missing = (wanted - given)[first:]
    through = given if felt is None else felt

    def fit(log_time: float) -> tuple[float, Array]:
        """Best gain at a time constant, and the error left."""
        lag = WakeState(1.0, float(np.exp(log_time)), 0.0).state_space(time_step, "input")
        lagged = (lag.simulate(through[:, None])[:, 0] - through)[first:]
        gain = float(lagged @ missing / (lagged @ lagged))
        return gain, missing - gain * lagged

    bounds = float(np.log(time_step)), float(np.log(len(given) * time_step))
    log_time = float(minimize_scalar(lambda x: (fit(x)[1] ** 2).sum(), bounds=bounds, method="bounded").x)
    gain, error = fit(log_time)
    misfit = np.abs(error).max() / abs(wanted[-1])
    return WakeState(gain=gain, time_constant=float(np.exp(log_time)), misfit=float(misfit))


def wake_transport(
    case: Case,
    circulation: ArrayLike,
    *,
    wake_length: float = 2.0,
    panels: int = 3,
) -> WakeTransport:
    """The states that make up for the case's fixed wake, by the root moment after a step of wind, and of each flap.

    The rigid rotor is marched with a long wake, which moves with the wind, until it has been renewed. Gains and time
    constants are those with which the case's own wake behind the states comes nearest, in least squares.

    Parameters
    ----------
    case : Case
        Its `discretisation.induction` slows both wakes alike.
    circulation : (strips,) float
        Mean circulation that each strip sheds [m^2/s].
    wake_length : float
        Length of the moving wake in rotor diameters; a third one adds 1.3 % to the wind's gain.
    panels : int
        Chordwise panels of the march, at most; 3 and 6 give the same gain to 0.3 %, the same time constant to 1 %.
    """
    own = case.discretisation.wake_length
    moving, fixed = march_case(case, max(wake_length, own), panels), march_case(case, own, panels)
    long, short = (build_aerodynamics(each) for each in (moving, fixed))
    wind, step = np.ones(wake_rows(moving)), moving.discretisation.time_step
    load, first = (
        root_moment_load(long, moving),
        len(long.force),
    )  # before that, the unsteady force is the step's own
    turned = [flap_downwash(short, flap)[0] for flap in case.flaps]
    struck = np.column_stack([gust_downwash(short).sum(axis=1), *turned])
    given = collective_responses(short, wind, struck, load)
    carried = moving_wake_response(long, circulation, wind, load)[:, 0]
    held = collective_responses(long, wind, struck[:, 1:], load)
    return WakeTransport(
        wind=fitted_state(given[:, 0], carried, step, first),
        flaps=tuple(
            fitted_state(cut, whole, step, first) for cut, whole in zip(given.T[1:], held.T, strict=True)
        ),
    )


def pitch_transport(
    case: Case,
    flow: MeanFlow,
    *,
    wake_length: float = 2.0,
    panels: int = 3,
) -> WakeState:
    """Velocity that the rotor meets as its wake gives way to collective pitch: gain x, x the pitch behind a lag.

    The gain is in m/s per radian; the velocity acts as a gust does that strikes the blades alone. The rigid rotor is
    marched with a long wake, as slow as the mean flow's, until it has been renewed. Momentum theory, C_T = 4 a (1 - a),
    tells the induction that goes with a change of thrust. Gain and time constant are those with which the case's own
    wake comes nearest in the root moment after a step of pitch, in least squares.

    Parameters
    ----------
    case : Case
    flow : MeanFlow
        The steady state whose wake it is.
    wake_length, panels
        As for `wake_transport`.
    """
    return _adapting_state(
        case, flow, pitch_downwash, lambda aero, load: np.zeros(len(load)), wake_length, panels
    )


def speed_transport(
    case: Case,
    flow: MeanFlow,
    *,
    wake_length: float = 2.0,
    panels: int = 3,
) -> WakeState:
    """The same as the rotor turns faster, its gain in m/s per rad/s: another thrust, a helix wound more closely.

    The mean circulation moves through the air faster, too, which counts in the thrust as much as what it grows by.
    """

    def carried_faster(aero: Aerodynamics, load: Array) -> Array:
        lead = leading_segments(aero.lattice)
        # Each strip's mean circulation stands on its first panel here: the march has fewer than the mean flow.
        around = np.tile(flow.shed, aero.lattice.chordwise)
        force = lead.force(aero.air_density, aero.inflow.per_rotor_speed(lead.midpoint)) @ around
        return np.asarray(load[:, : force.size] @ force.ravel())

    def struck(aero: Aerodynamics) -> Array:
        return spin_downwash(aero, flow.loads.zero_lift_angle)

    return _adapting_state(case, flow, struck, carried_faster, wake_length, panels, winds=True)


def _adapting_state(
    case: Case,
    flow: MeanFlow,
    downwash: Callable[[Aerodynamics], Array],
    direct: Callable[[Aerodynamics, Array], Array],
    wake_length: float,
    panels: int,
    winds: bool = False,
) -> WakeState:
    """The state for a collective input of some downwash (n,) on a lattice, and of some loads (ny,) at once.

    ``winds`` says that it is the rotor's speed, which winds the wake up.
    """
    wind, own = flow.aero.inflow.velocity[0], case.discretisation.wake_length
    slow = replace(case.discretisation, induction=float(1.0 - flow.aero.inflow.wake_velocity[0] / wind))
    adapting = march_case(replace(case, discretisation=slow), max(wake_length, own), panels)
    fixed = march_case(case, own, panels)
    long, short = (build_aerodynamics(each) for each in (adapting, fixed))
    step, steps = fixed.discretisation.time_step, np.ones(long.wake_rows)
    area = np.pi * case.turbine.rotor.radius**2
    per_thrust = momentum_slope(flow.loads.thrust_coefficient) / (0.5 * long.air_density * wind**2 * area)
    loads = np.concatenate([thrust_load(long), root_moment_load(long, adapting)])
    wanted = adapting_wake_response(
        long,
        flow.shed,
        steps,
        downwash(long),
        loads,
        direct(long, loads),
        slowing=wind * per_thrust,
        wound=displaced_wake_downwash(long, flow.shed, turned=True) if winds else None,
    )
    struck = np.column_stack([downwash(short), gust_downwash(short).sum(axis=1)])
    moment = root_moment_load(short, fixed)
    given, felt = collective_responses(short, steps, struck, moment).T
    return fitted_state(given + direct(short, moment), wanted[:, 1], step, len(long.force), felt)


def collective_responses(aero: Aerodynamics, signal: Array, downwash: Array, load: Array) -> Array:
    """One load (T, nu) in time after each of some inputs of downwash (n, nu) by itself follows a signal (T,)."""
    columns = [collective_response(aero, signal[:, None], w[:, None], load)[:, 0] for w in downwash.T]
    return np.stack(columns, axis=-1)
