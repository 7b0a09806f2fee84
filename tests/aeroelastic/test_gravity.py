"""Gravity as an input: weights of blades, rotor, nacelle and tower, in the motion and in the loads."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.blade_lattice import BladeLattice
from flapgym.aeroelastic.build import build_model
from flapgym.aeroelastic.equations import Parts, rigid_turns, turbine_equations
from flapgym.model import load_model, save_model
from flapgym.model.reduced import reduced_model
from flapgym.reduction import normal_modes
from flapgym.structure import linear_blade, linear_support, mean_gravity_load
from flapgym.structure.beam import tangent
from flapgym.structure.blade import blade_beam
from flapgym.structure.support import tower_beam
from flapgym.turbine import Signals, load_case
from tests.aeroelastic.test_signals import small

CASE = load_case("nrel5mw-rated")
OUTPUTS = ("rbm_edge", "tower_base_fore_aft", "tower_base_side_side", "flapwise_moment_40")
TILT, CONE = CASE.turbine.rotor.tilt, CASE.turbine.rotor.precone


def heavy(elements=12, load=None):
    """All modes of blades and support, a blade bent by a load, and a lattice that does nothing."""
    case = replace(
        CASE,
        discretisation=replace(CASE.discretisation, blade_elements=elements, first_lattice_node=elements - 2),
        reduction=replace(CASE.reduction, tower_modes=66),
        signals=Signals(outputs=OUTPUTS, gravity=True),
    )
    blade = linear_blade(case.turbine, elements, case.rotor_speed, load=load)
    modes = 6 * elements
    frequency, shape = normal_modes(blade.mass, blade.stiffness, modes)
    nothing = BladeLattice(np.zeros((1, 2 * modes + 11)), np.zeros((modes + 7, 3)), modes, flaps=1, strips=1)
    return Parts(case, blade, linear_support(case.turbine, case.rotor_speed), frequency, shape, nothing)


def steady_load():
    """Nodal loads (13, 6) that bend the blade by some metres."""
    load = np.zeros((13, 6))
    load[1:, :2] = [8e3, -1e3]
    return load


@pytest.fixture(scope="module")
def bent():
    return heavy(load=steady_load())


def under_gravity(parts):
    """Static motion and named outputs per unit of gravity."""
    equations = turbine_equations(parts)
    place = equations.inputs.index("gravity")
    d = np.linalg.solve(equations.structure.stiffness, equations.forcing[:, place])
    y = equations.output.position @ d + equations.output.direct[:, place]
    return d, dict(zip(equations.outputs, y, strict=True)), equations


def falls(azimuth):
    """Direction of weight in the frame of a blade at an azimuth, by hand."""
    return np.array([np.sin(TILT), -np.cos(TILT) * np.sin(azimuth), -np.cos(TILT) * np.cos(azimuth)])


def test_rigid_blade_s_edgewise_amplitude_is_its_published_first_mass_moment_times_gravity():
    """NREL/TP-500-38060, Table 2-2: 363,231 kg m about the root; wind.md's trial has 3.6 MN m."""
    equations = turbine_equations(heavy(elements=48))
    told = dict(zip(equations.outputs, equations.output.direct[:, -1], strict=True))
    amplitude = np.hypot(told["rbm_edge_c"], told["rbm_edge_s"])
    # The tilt leaves its cosine; the published stations themselves give half a percent less.
    assert amplitude == pytest.approx(363_231.0 * np.cos(TILT), rel=0.01)
    # Greatest where the blade is level and goes down: a quarter turn after it stood up.
    assert told["rbm_edge_s"] > 0.999 * amplitude


def test_weight_of_the_bent_blade_turns_its_root_as_the_sum_over_its_elements(bent):
    """Flapwise and edgewise, mean and once a revolution: from cone, tilt, sweep of the mass and steady deflection."""
    blade, beam = bent.blade, blade_beam(bent.case.turbine, 12)
    length = np.linalg.norm(np.diff(beam.reference.position, axis=0), axis=1)[:, None]
    mid = 0.5 * (blade.position[1:] + blade.position[:-1]) - blade.position[0]
    aft = 0.5 * (blade.orientation[1:, :, 2] + blade.orientation[:-1, :, 2])
    first = (length * (beam.mass[:, :1, 0] * mid + beam.mass[:, 4, 0, None] * aft)).sum(axis=0)
    equations = turbine_equations(bent)
    told = dict(zip(equations.outputs, equations.output.direct[:, -1], strict=True))
    for name, axis in (("rbm", [0.0, 1.0, 0.0]), ("rbm_edge", [np.cos(CONE), 0.0, np.sin(CONE)])):
        for azimuth in (0.0, 0.7, 2.0, 4.4):
            ours = (
                told[f"{name}_0"] + told[f"{name}_c"] * np.cos(azimuth) + told[f"{name}_s"] * np.sin(azimuth)
            )
            theirs = np.cross(first, falls(azimuth)) @ axis
            assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-3)


def test_mean_weight_bends_the_blade_as_the_non_linear_beam_does():
    """Full nodes of the finite elements and their own equilibrium, against modes and consistent weights; hub held."""
    parts, size = heavy(), 1e-2
    equations = turbine_equations(parts)
    m = parts.lattice.modes
    a = np.linalg.solve(equations.structure.stiffness[:m, :m], equations.forcing[:m, -1])
    ours = (parts.shape @ a).reshape(-1, 6)[:, :3]
    gravity = parts.case.turbine.gravity
    load = size * mean_gravity_load(parts.case.turbine)
    after = linear_blade(parts.case.turbine, 12, parts.case.rotor_speed, load=load, near=parts.blade)
    moved = (after.position - parts.blade.position)[1:] / (size * gravity)
    np.testing.assert_allclose(ours, moved, atol=1e-4 * np.abs(moved).max())


def test_all_weights_together_are_the_published_masses():
    """NREL/TP-500-38060: blades of 17,740 kg, hub 56,780, nacelle 240,000, tower 347,460 kg."""
    parts = heavy(elements=48)
    _, shape = parts.modal_support
    down = np.tile([0.0, 0.0, -1.0, 0.0, 0.0, 0.0], 11)
    fall = np.linalg.lstsq(shape, down, rcond=None)[0]  # all nodes but the foundation's come down alike
    total = turbine_equations(parts).forcing[3 * parts.lattice.modes :, -1] @ fall
    tower = tower_beam(parts.case.turbine)  # whose lowest element leans on the foundation with a half
    lowest = np.linalg.norm(np.diff(tower.reference.position[:2], axis=0)) * tower.mass[0, 0, 0]
    published = 3 * 17_740.0 + 56_780.0 + 240_000.0 + 347_460.0
    assert total + 0.5 * lowest == pytest.approx(published, rel=1e-3)


def test_moments_on_the_foundation_are_those_of_the_masses_ahead_of_and_behind_the_tower():
    """By hand on the undeflected turbine: the nacelle is 1.9 m downwind, the blades turn about the apex ahead of it."""
    parts = heavy()  # without a steady load, whose arm would change as the blades sag
    _, told, _ = under_gravity(parts)
    turbine = parts.case.turbine
    blade, beam = parts.blade, blade_beam(turbine, 12)
    length = np.linalg.norm(np.diff(beam.reference.position, axis=0), axis=1)[:, None]
    mid = 0.5 * (blade.position[1:] + blade.position[:-1])
    aft = 0.5 * (blade.orientation[1:, :, 2] + blade.orientation[:-1, :, 2])
    along = float((length * (beam.mass[:, :1, 0] * mid + beam.mass[:, 4, 0, None] * aft)).sum(axis=0)[0])
    mass = float((length[:, 0] * beam.mass[:, 0, 0]).sum())
    ahead = parts.support.apex[0]
    moment = turbine.nacelle.mass * turbine.nacelle.downwind + (3.0 * mass + turbine.hub.mass) * ahead
    moment += 3.0 * along * np.cos(TILT)
    assert told["tower_base_fore_aft"] == pytest.approx(moment, rel=1e-4)
    assert abs(told["tower_base_side_side"]) < 1e-3 * abs(moment)


def test_moments_on_the_foundation_are_the_lowest_element_s_elastic_reaction(bent):
    d, told, _ = under_gravity(bent)
    _, shape = bent.modal_support
    tower = tower_beam(bent.case.turbine)
    q = (shape @ d[3 * bent.lattice.modes :])[: 6 * tower.elements]
    reaction = tangent(tower, tower.reference)[:6, 6:] @ q
    assert told["tower_base_fore_aft"] == pytest.approx(-reaction[4], rel=1e-6)


def test_root_moments_of_the_bent_blade_are_the_reaction_of_its_root_element(bent):
    """At rest in the rotating frame: the mean part, elastic and centrifugal, against the beam's own matrices."""
    d, told, _ = under_gravity(bent)
    m, blade = bent.lattice.modes, bent.blade
    beam = blade_beam(bent.case.turbine, 12)
    half = beam.mass[0, 0, 0] * np.linalg.norm(beam.reference.position[1] - beam.reference.position[0])
    reaction = blade.root_stiffness @ bent.shape @ d[:m]
    for name, axis in (("rbm_0", [0.0, 1.0, 0.0]), ("rbm_edge_0", [np.cos(CONE), 0.0, np.sin(CONE)])):
        # The root node bears a share of the first element's sections by itself, on no arm to speak of.
        assert told[name] == pytest.approx(-float(np.dot(axis, reaction[3:])), rel=1e-4, abs=half)


def test_weight_comes_as_moments_along_the_blade_too(bent):
    _, told, _ = under_gravity(bent)
    assert abs(told["flapwise_moment_40_0"]) < 0.4 * abs(told["rbm_0"])
    assert told["flapwise_moment_40_0"] * told["rbm_0"] > 0.0


def test_weight_on_the_foundation_s_arm_is_the_work_in_a_rigid_turn(bent):
    """The nacelle's and hub's weights by their places: M x about the base."""
    turbine, turns = bent.case.turbine, rigid_turns(bent.support)
    moment = turns[:, 0] @ bent.support.weight
    expected = turbine.nacelle.mass * turbine.nacelle.downwind + turbine.hub.mass * bent.support.apex[0]
    assert moment == pytest.approx(expected, rel=1e-9)


@pytest.fixture(scope="module")
def model():
    case = small(outputs=("rbm_edge",))
    return build_model(replace(case, signals=replace(case.signals, gravity=True)))


def test_gravity_costs_no_state_and_leaves_all_else_as_it_is(model, tmp_path):
    plain = build_model(small(outputs=("rbm_edge",))).turbine
    ours = model.turbine
    assert ours.inputs == (*plain.inputs, "gravity")
    for matrix in ("A", "C"):
        np.testing.assert_array_equal(getattr(ours, matrix), getattr(plain, matrix))
    for matrix in ("B", "D"):
        np.testing.assert_allclose(
            getattr(ours, matrix)[:, :-1], getattr(plain, matrix), rtol=1e-12, atol=1e-9
        )
    save_model(model, tmp_path / "heavy.safetensors")
    assert load_model(tmp_path / "heavy.safetensors").turbine.inputs == ours.inputs


def test_blade_sags_downwind_on_the_mean_and_the_tower_leans_to_the_heavier_side(model):
    gain = dict(zip(model.turbine.outputs, model.turbine.dc_gain()[:, -1], strict=True))
    assert gain["rbm_0"] > 0.0  # the shaft is tilted, weight has a part downwind
    assert gain["tower_fore_aft"] < 0.0  # rotor ahead of the tower outweighs the nacelle


def test_gravity_where_no_answer_is_prepared_is_refused_in_a_line(model):
    with pytest.raises(ValueError, match="signals.gravity: expected True or False, got 9.81"):
        Signals(gravity=9.81)
    case = small()
    weighed = replace(case, signals=Signals(gravity=True))
    with pytest.raises(ValueError, match="coupled_tolerance: expected 0 % with signals.gravity"):
        build_model(replace(weighed, reduction=replace(case.reduction, coupled_tolerance=0.01)))
    with pytest.raises(ValueError, match="reduced_model: expected flaps and wind as inputs, got gravity"):
        reduced_model(model, 0.01)
