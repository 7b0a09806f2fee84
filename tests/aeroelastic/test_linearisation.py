"""The loads' linear terms against differences of the lattice's non-linear steady forces, and against symmetries."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from flapgym.aerodynamics import (
    MeanFlow,
    bound_segments,
    build_aerodynamics,
    cambered,
    convected_gust_downwash,
    flap_downwash,
    full_loads,
    mean_loads,
    steady_circulation,
    steady_response,
)
from flapgym.aerodynamics.biot_savart import induced_velocity
from flapgym.aerodynamics.lattice import Inflow, rotation_about_x, wake_nodes
from flapgym.aerodynamics.response import transfer_function
from flapgym.aerodynamics.steady import incidence_downwash, joukowski_force
from flapgym.aeroelastic.blade_lattice import blade_lattice, lattice_response
from flapgym.aeroelastic.interaction import following_moments, lattice_shape
from flapgym.aeroelastic.lattice_motion import lattice_motion, segment_motion
from flapgym.aeroelastic.trim import trim
from flapgym.reduction import normal_modes
from flapgym.structure import linear_blade
from flapgym.structure.rotation import rotation_matrix
from flapgym.turbine import load_case

MODES = 13
HUB_VELOCITY, HUB_TURN, FLAP, GUST = 2 * MODES, 2 * MODES + 6, 2 * MODES + 8, 2 * MODES + 10
CORRECTED = load_case("nrel5mw-corrected")
# The lattice's own wake behind the mean load too and flat plates' slopes: then one steady lattice has both the mean
# state and its perturbations. Few panels and a short wake, on which no claim here depends.
CASE = replace(
    CORRECTED,
    airloads=replace(CORRECTED.airloads, mean_wake="perturbations", lift_slope="thin aerofoil"),
    discretisation=replace(CORRECTED.discretisation, chordwise_panels=4, time_step=0.0175, wake_length=0.1),
)


@dataclass(frozen=True, eq=False)
class Moving(Inflow):
    """An inflow past a blade that also has a velocity and a rate of turn (3,) of its own in the rotating frame."""

    moves: np.ndarray
    turns: np.ndarray

    def relative_velocity(self, point):
        return super().relative_velocity(point) - self.moves - np.cross(self.turns, point)


class Linearised:
    """A case's trimmed blade and the linear steady forces on its bound segments."""

    def __init__(self, case):
        self.case, self.balance = case, trim(case)
        self.blade, self.aero = self.balance.blade, self.balance.rotor
        _, self.shape = normal_modes(self.blade.mass, self.blade.stiffness, MODES)
        self.flow = MeanFlow(self.balance.mean, self.balance.loads)
        self.lattice = blade_lattice(case, self.aero, self.blade, self.shape, self.flow)
        motion = lattice_motion(case, self.blade, self.shape, self.flow)
        self.segments = segment_motion(case, self.aero, motion)
        self.point = bound_segments(self.aero.lattice).midpoint
        every = np.eye(3 * len(self.aero.force_point))[: 3 * len(self.point)]
        self.every = every
        self.full = full_loads(self.aero, self.flow, self.segments, every)
        linear = steady_response(self.aero, self.lattice.downwash, every, self.full)
        self.linear = linear.reshape(len(self.point), 3, -1)

    def displaced(self, mode, size):
        """Forces (q, 3) [N] with a mode held displaced."""
        positions, turned = lattice_shape(self.case, self.blade)
        nodes = np.vstack([np.zeros(6), size * self.shape[:, mode].reshape(-1, 6)])
        nodes = nodes[self.case.discretisation.first_lattice_node :]
        turned = rotation_matrix(nodes[:, 3:]) @ turned
        return self.forces(build_aerodynamics(self.case, 3, positions + nodes[:, :3], turned))

    def forces(self, aero=None, flap=0.0):
        """Non-linear steady forces (q, 3) [N]: circulation that the downwash asks for, in the total velocity."""
        aero = aero or self.aero
        downwash = incidence_downwash(aero, self.flow.loads.zero_lift_angle)
        downwash = downwash + flap * flap_downwash(aero, self.case.flaps[0])[0]
        return joukowski_force(aero, steady_circulation(aero, downwash[:, None])[:, 0])

    def moved(self, moves=(0.0, 0.0, 0.0), turns=(0.0, 0.0, 0.0)):
        """Forces (q, 3) [N] on the blade with a velocity of its own."""
        own = self.aero.inflow
        inflow = Moving(own.velocity, own.rotor_speed, own.wake_velocity, np.array(moves), np.array(turns))
        return self.forces(replace(self.aero, inflow=inflow))


@pytest.fixture(scope="module")
def lin():
    return Linearised(CASE)


def differenced(forces, size):
    return (forces(size) - forces(-size)) / (2.0 * size)


def assert_same(point, linear, wanted, within=1e-3):
    """Forces by segment, and their torque about the shaft over the size of its contributions."""
    assert np.linalg.norm(linear - wanted) < within * np.linalg.norm(wanted)
    ours, theirs = (np.cross(point, force)[:, 0] for force in (linear, wanted))
    assert abs(ours.sum() - theirs.sum()) < within * np.abs(theirs).sum()


def test_gust(lin):
    wanted = differenced(lambda u: lin.moved((-u, 0.0, 0.0)), 0.1)
    gust = lin.linear[:, :, GUST:].sum(axis=2)
    assert_same(lin.point, gust, wanted)
    torque = [np.cross(lin.point, force)[:, 0].sum() for force in (gust, wanted)]
    assert torque[0] == pytest.approx(torque[1], rel=1e-3)


def test_flap(lin):
    wanted = differenced(lambda angle: lin.forces(flap=angle), 1e-3)
    assert_same(lin.point, lin.linear[:, :, FLAP], wanted)


@pytest.mark.parametrize("mode", range(MODES))
def test_mode_held_displaced(lin, mode):
    shape = lin.shape[:, mode].reshape(-1, 6)
    # A centimetre, or as much at the edge of a chord of 3 m where the mode twists.
    size = 0.01 / max(np.abs(shape[:, :3]).max(), 3.0 * np.abs(shape[:, 3:]).max())
    wanted = differenced(lambda d: lin.displaced(mode, d), size)
    assert_same(lin.point, lin.linear[:, :, MODES + mode], wanted)


@pytest.mark.parametrize("direction", range(6))
def test_velocity_of_the_hub_along_and_about_each_axis(lin, direction):
    axis = np.eye(3)[direction % 3]
    parts = (lambda v: lin.moved(v * axis)) if direction < 3 else (lambda v: lin.moved(turns=v * axis))
    size = 0.1 if direction < 3 else 1e-3
    assert_same(lin.point, lin.linear[:, :, HUB_VELOCITY + direction], differenced(parts, size))


@pytest.mark.parametrize("turn", [0, 1])
def test_rotor_turned_out_of_the_wind(lin, turn):
    """About y and z, axes and segments carried along: the wind alone changes, by -phi x U."""
    wind = np.array([CASE.operating_point.wind_speed, 0.0, 0.0])
    axis = np.eye(3)[1 + turn]
    wanted = differenced(lambda angle: lin.moved(np.cross(angle * axis, wind)), 1e-2)
    assert_same(lin.point, lin.linear[:, :, HUB_TURN + turn], wanted)


def test_gust_on_one_blade_alone():
    """Its own forces and those of the two other blades: collective and whirl together, against all blades' rings."""
    case = replace(CASE, discretisation=replace(CASE.discretisation, chordwise_panels=2, time_step=0.035))
    lin = Linearised(case)
    aero, n, strips = lin.aero, lin.aero.normal.shape[0], lin.aero.lattice.strips
    gust = lin.lattice.downwash[:, GUST:].sum(axis=1, keepdims=True)
    full = replace(lin.full, direct=lin.full.direct[:, GUST:].sum(axis=1, keepdims=True))
    collective, whirl = (transfer_function(aero, m, 1.0, gust, lin.every, full)[0, :, 0] for m in (0, 1))
    turns = [rotation_about_x(2.0 * np.pi * blade / 3) for blade in range(3)]

    def velocity(point, circulation):
        """At points of blade 0 [m/s], of all blades' rings with their own circulations (3, n)."""
        wake = wake_nodes(aero.lattice, aero.inflow, aero.wake_age)
        total = np.zeros_like(point)
        for turn, own in zip(turns, circulation, strict=True):
            bound = own.reshape(-1, strips)
            shed = np.broadcast_to(bound[-1], (aero.wake_rows, strips))
            total += induced_velocity(point, aero.lattice.node @ turn.T, bound)
            total += induced_velocity(point, wake @ turn.T, shed)
        return total

    influence = np.stack(
        [
            (velocity(aero.collocation, unit) * aero.normal).sum(axis=1)
            for unit in np.eye(3 * n).reshape(-1, 3, n)
        ],
        axis=1,
    ).reshape(n, 3, n)
    # What blade j feels of blade b is what blade 0 feels of blade b - j.
    system = np.block([[influence[:, (b - j) % 3] for b in range(3)] for j in range(3)])

    def forces(size):
        """Of all blades (3, q, 3) [N] when blade 0 alone meets a gust."""
        downwash = np.tile(incidence_downwash(aero, lin.flow.loads.zero_lift_angle), (3, 1))
        downwash[0] += size * gust[:, 0]
        around = -np.linalg.solve(system, downwash.ravel()).reshape(3, n)
        segments, out = bound_segments(aero.lattice), []
        for blade in range(3):
            flow = aero.inflow.relative_velocity(segments.midpoint)
            flow[:n] += velocity(segments.midpoint[:n], np.roll(around, -blade, axis=0))
            flow[:, 0] += size * (blade == 0)
            net = segments.net @ around[blade]
            out.append(aero.air_density * net[:, None] * np.cross(flow, segments.vector))
        return np.stack(out)

    wanted = differenced(forces, 0.1)
    for blade in range(3):
        phase = np.exp(2j * np.pi * blade / 3)
        linear = (collective + 2.0 * np.real(phase * whirl)) / 3.0
        assert_same(lin.point, linear.reshape(-1, 3), wanted[blade])


@pytest.fixture(scope="module")
def rigid():
    """The corrected rotor, its blade's nodes moved as a rigid body along and about the axes in place of its modes."""
    grid = CASE.discretisation
    case = replace(CORRECTED, discretisation=grid)
    blade = linear_blade(case.turbine, 12, case.rotor_speed)
    aero = build_aerodynamics(case, 3, *lattice_shape(case, blade))
    flow = MeanFlow(aero, mean_loads(case, aero))
    points = blade.position[1:]
    shape = np.zeros((len(points), 6, 6))
    shape[:, :3, :3] = shape[:, 3:, 3:] = np.eye(3)
    for i in range(3):
        shape[:, :3, 3 + i] = np.cross(np.eye(3)[i], points)
    shape = shape.reshape(-1, 6)
    return case, aero, blade, flow, shape, blade_lattice(case, aero, blade, shape, flow)


def columns(lattice, *names):
    chosen = lattice.select(*names)
    return lattice.downwash @ chosen, lattice.full.direct @ chosen


def test_rate_of_a_rigid_motion_is_the_velocity_of_the_hub(rigid):
    lattice = rigid[-1]
    for ours, theirs in zip(columns(lattice, "mode_rate"), columns(lattice, "hub_velocity"), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-6 * np.abs(theirs).max())


def test_velocity_along_the_shaft_is_a_gust_of_the_opposite_sign(rigid):
    lattice = rigid[-1]
    for moving, gust in zip(columns(lattice, "hub_velocity"), columns(lattice, "gust"), strict=True):
        np.testing.assert_allclose(moving[:, 0], -gust.sum(axis=1), atol=1e-9 * np.abs(moving).max())


def test_rotor_held_further_along_its_shaft_is_the_same_rotor(rigid):
    lattice = rigid[-1]
    for held in columns(lattice, "mode"):
        np.testing.assert_allclose(held[:, 0], 0.0, atol=1e-6 * np.abs(held).max())


def test_rotor_held_at_another_azimuth_carries_its_forces_along(rigid):
    """The downwash is the same, the force on the hub turns with the blade."""
    _, _, _, flow, _, lattice = rigid
    downwash, direct = columns(lattice, "mode")
    np.testing.assert_allclose(downwash[:, 3], 0.0, atol=1e-6 * np.abs(downwash).max())
    q = len(bound_segments(flow.aero.lattice).midpoint)
    turned = np.cross([1.0, 0.0, 0.0], flow.loads.force[:q].sum(axis=0))
    np.testing.assert_allclose(direct[6:9, 3], turned, atol=1e-5 * np.abs(turned).max())


def test_forces_and_moments_of_the_mean_load_turn_with_their_sections(rigid):
    """A force on an arm and a pitching moment at the middle of an element of the straight blade, by hand."""
    _, _, blade, flow, _, _ = rigid
    foot = 0.5 * (blade.position[6] + blade.position[7])
    along = blade.position[-1] - blade.position[0]
    along /= np.linalg.norm(along)
    arm = np.cross(along, [1.0, 0.0, 0.0])
    force, couple = np.array([5.0, -2.0, 1.0]), 3.0 * along
    loads = replace(
        flow.loads,
        force_point=(foot + arm)[None],
        force=force[None],
        couple_point=foot[None],
        couple=couple[None],
    )
    shape = np.zeros((len(blade.position) - 1, 6, 3))
    shape[:, 3:] = np.eye(3)  # all sections turn, the axis stays
    found = following_moments(blade, loads, shape.reshape(-1, 3), np.zeros((shape.size // 3, 0)))
    for i, axis in enumerate(np.eye(3)):
        moment = np.cross(np.cross(axis, arm), force) + np.cross(axis, couple)
        np.testing.assert_allclose(found[-3:, i], moment, atol=1e-9)
        np.testing.assert_allclose(found[:3, i], moment, atol=1e-9)  # the work of that moment in each turn
        np.testing.assert_allclose(found[3:6, i], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    "airloads", [load_case("nrel5mw-rated").airloads, CASE.airloads], ids=["paper", "full"]
)
def test_gust_along_the_chord_reaches_each_panel_late_and_nothing_else_changes(airloads):
    """Against the loads of the delayed downwash itself; the mean circulation still meets the gust at once."""
    case = replace(CASE, airloads=airloads, discretisation=replace(CASE.discretisation, gust="convected"))
    blade = linear_blade(case.turbine, 12, case.rotor_speed)
    aero = build_aerodynamics(case, 1, *lattice_shape(case, blade))
    flow, shape = MeanFlow(aero, mean_loads(case, aero)), normal_modes(blade.mass, blade.stiffness, 3)[1]
    along = blade_lattice(case, aero, blade, shape, flow)
    at_once = replace(along, convected=False)
    z = np.exp(2j * np.pi * np.array([0.0, 0.05, 0.2]))
    ours, theirs = (lattice_response(aero, lattice, 0, z) for lattice in (along, at_once))
    felt = cambered(aero, flow.loads.zero_lift_angle) if along.full else aero
    full = replace(along.full, direct=along.full.direct[:, -10:]) if along.full else None
    wanted = transfer_function(aero, 0, z, convected_gust_downwash(felt, z), along.load, full)
    size = np.abs(wanted).max()
    np.testing.assert_allclose(ours[:, :, -10:], wanted, atol=1e-9 * size)
    np.testing.assert_allclose(ours[:, :, :-10], theirs[:, :, :-10], rtol=1e-12)
    np.testing.assert_allclose(ours[0], theirs[0], rtol=1e-9, atol=1e-9 * size)
    assert np.abs(ours[2] - theirs[2]).max() > 0.01 * size
