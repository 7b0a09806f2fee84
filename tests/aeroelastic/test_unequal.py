"""Unequal blades: the periodic form in multi-blade coordinates against the blades' own frames and the constant form."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.io
import scipy.linalg

from flapgym.aeroelastic.blade_lattice import reduce_stacked
from flapgym.aeroelastic.build import assemble_parts, azimuth_steps, build_model, slow_wake
from flapgym.aeroelastic.coupling import couple, multiblade_aerodynamics
from flapgym.aeroelastic.equations import periodic_equations, turbine_equations
from flapgym.aeroelastic.periodic import step_matrices
from flapgym.aeroelastic.unequal import assemble_unequal, multiblade_equations, unequal_equations
from flapgym.core.multiblade import to_blades, to_components
from flapgym.core.state_space import series
from flapgym.model import load_model, save_model
from flapgym.model.export import save_mat
from flapgym.model.harmonics import fourier_series, simulate_periodic, system_at
from flapgym.structure import assemble
from flapgym.structure.blade import blade_beam
from flapgym.turbine import Signals, load_case
from reference.floquet import floquet_multipliers

CASE = load_case("nrel5mw-rated")
DT = 0.02
RNG = np.random.default_rng(3)


def coarse(**blades):
    """A small case whose blades differ as told."""
    grid = replace(CASE.discretisation, chordwise_panels=2, wake_length=0.05, time_step=DT)
    reduction = replace(CASE.reduction, blade_modes=4, tower_modes=4, aerodynamic_states=8)
    return replace(CASE, discretisation=grid, reduction=reduction, blades=replace(CASE.blades, **blades))


@pytest.fixture(scope="module")
def equal():
    """Parts of equal blades and their lattice's two components."""
    parts, aero = assemble_parts(coarse())
    return parts, [reduce_stacked(aero, [parts.lattice], m, 8) for m in (0, 1)]


def small_corrected(**blades):
    """The corrected turbine, as small; a short mean wake of its own, and the states of a moving one."""
    corrected = load_case("nrel5mw-corrected")
    airloads = replace(corrected.airloads, mean_wake=0.1, mean_induction=0.2)
    return replace(coarse(**blades), airloads=airloads)


@pytest.mark.parametrize(
    "signals", [Signals(), Signals(wind="by strip", gravity=True)], ids=["plain", "site"]
)
def test_corrected_turbine_of_equal_blades_is_the_time_invariant_form_at_every_azimuth(signals):
    """The moving wake's states among the others, and what the wind of a site adds to the inputs."""
    case = replace(small_corrected(), signals=signals)
    alike, aero = assemble_parts(case)
    components = [reduce_stacked(aero, [alike.lattice], m, 8) for m in (0, 1)]
    rotor = multiblade_aerodynamics(*components, CASE.rotor_speed, DT)
    still = series(slow_wake(alike), couple(turbine_equations(alike), rotor, DT))
    parts, _ = assemble_unequal(case)
    at = azimuth_steps(parts, rotor, slow_wake(parts.mean))
    assert still.order == couple(turbine_equations(alike), rotor, DT).order + 2
    for azimuth in (0.0, 1.1, 4.0):
        step, forcing = at(azimuth)
        assert step.inputs == still.inputs
        for name in "AC":
            ours, theirs = getattr(step, name), getattr(still, name)
            np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-11 * np.abs(theirs).max())
        for name in "BD":  # gravity's unit is far from a flap's
            ours, theirs = getattr(step, name), getattr(still, name)
            size = np.abs(theirs).max(axis=0)
            np.testing.assert_allclose(ours / size, theirs / size, rtol=0.0, atol=1e-11)
        np.testing.assert_allclose(forcing, 0.0, atol=1e-12)


def test_corrected_turbine_with_a_heavy_blade_builds_stable_and_near_the_one_of_its_mean_blade():
    model = build_model(small_corrected(mass_factor=(1.05, 1.0, 1.0)))
    assert np.abs(floquet_multipliers(model)).max() < 1.0
    mean = build_model(small_corrected(mass_factor=(1.05, 1.0, 1.0)).of_mean_blade())
    ours, theirs = (m.turbine.dc_gain()[[0, 3]][:, [0, 6]] for m in (model, mean))
    np.testing.assert_allclose(ours, theirs, rtol=1e-2)


@pytest.fixture(scope="module")
def unequal():
    """Parts of blades that differ in everything and their lattices' two components."""
    parts, aero = assemble_unequal(
        coarse(
            mass_factor=(1.0, 1.0, 1.02),
            stiffness_factor=(1.0, 0.97, 1.0),
            pitch_offset=(0.0, 0.005, 0.0),
            flap_effectiveness=(1.0, 1.0, 0.5),
        )
    )
    lattices = [own.lattice for own in parts.lattices]
    return parts, [reduce_stacked(aero, lattices, m, 8) for m in (0, 1)]


def test_equal_blades_are_the_time_invariant_form_at_every_azimuth(equal):
    parts, components = equal
    fixed = multiblade_aerodynamics(*components, CASE.rotor_speed, DT)
    still = couple(turbine_equations(parts), fixed, DT)
    by_azimuth = multiblade_equations(periodic_equations(parts))
    for azimuth in (0.0, 1.1, 4.0):
        step = step_matrices(by_azimuth, fixed, DT, azimuth, CASE.rotor_speed * DT)
        for ours, theirs in zip(step, (still.A, still.B, still.C, still.D), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-12 * np.abs(theirs).max())


@pytest.mark.parametrize("azimuth", [0.0, 2.2])
def test_structure_of_unequal_blades_is_the_direct_assembly_in_shapes(unequal, azimuth):
    parts, _ = unequal
    ours = unequal_equations(parts)(azimuth).structure
    shapes = scipy.linalg.block_diag(*(own.shape for own in parts.blades), parts.mean.modal_support[1])
    theirs = assemble([own.blade for own in parts.blades], parts.mean.support, azimuth)
    for name, full in (("mass", theirs[0]), ("stiffness", theirs[2])):
        expected = shapes.T @ full @ shapes
        np.testing.assert_allclose(getattr(ours, name), expected, atol=1e-9 * np.abs(expected).max())


@pytest.fixture(scope="module")
def weighed(unequal):
    """The same blades under gravity, with support modes enough for the hub to move in every way."""
    parts, _ = unequal
    case = parts.mean.case
    case = replace(case, signals=Signals(gravity=True), reduction=replace(case.reduction, tower_modes=12))
    mean = replace(parts.mean, case=case)
    return replace(parts, mean=mean), unequal_equations(replace(parts, mean=mean))


def masses(own):
    """Mass [kg] and first mass moment (3,) about the apex [kg m] of a bent blade, element by element."""
    blade, beam = own.blade, blade_beam(own.case.turbine, own.case.discretisation.blade_elements)
    length = np.linalg.norm(np.diff(beam.reference.position, axis=0), axis=1)[:, None]
    mid = 0.5 * (blade.position[1:] + blade.position[:-1])
    aft = 0.5 * (blade.orientation[1:, :, 2] + blade.orientation[:-1, :, 2])
    first = (length * (beam.mass[:, :1, 0] * mid + beam.mass[:, 4, 0, None] * aft)).sum(axis=0)
    return float((length[:, 0] * beam.mass[:, 0, 0]).sum()), first


def into_the_blade(azimuth):
    """Rotation (3, 3) from the shaft's axes to those of a blade at an azimuth."""
    cosine, sine = np.cos(azimuth), np.sin(azimuth)
    return np.array([[1.0, 0.0, 0.0], [0.0, cosine, sine], [0.0, -sine, cosine]])


@pytest.mark.parametrize("azimuth", [0.0, 2.2])
def test_each_blade_hangs_on_the_hub_with_a_weight_and_an_arm_of_its_own(weighed, azimuth):
    """Force and moment about the apex, in the shaft's axes: sums over the elements of three bent blades."""
    parts, equations = weighed
    at, tilt = equations(azimuth), parts.mean.case.turbine.rotor.tilt
    down = np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    forcing = at.forcing[3 * equations.modes :, at.inputs.index("gravity")] - equations.weight[1]
    load = np.linalg.lstsq(equations.hub.T, forcing, rcond=None)[0]
    force, moment = np.zeros(3), np.zeros(3)
    for b, own in enumerate(parts.blades):
        mass, first = masses(own)
        force += mass * down
        moment += np.cross(into_the_blade(azimuth + 2.0 * np.pi * b / 3.0).T @ first, down)
    np.testing.assert_allclose(load[:3], force, atol=1e-9 * np.abs(force).max())
    np.testing.assert_allclose(load[3:], moment, atol=1e-9 * np.abs(moment).max())
    # The third blade is heavier: what is left about the shaft is its surplus, at sin of its azimuth.
    surplus = 0.02 * 17740.0 * (20.475 + 1.5) * np.cos(tilt) * np.sin(azimuth + 4.0 * np.pi / 3.0)
    assert load[3] == pytest.approx(surplus, rel=0.08)


@pytest.mark.parametrize("azimuth", [0.0, 2.2])
def test_weight_of_each_bent_blade_turns_its_own_root(weighed, azimuth):
    parts, equations = weighed
    at, tilt = equations(azimuth), parts.mean.case.turbine.rotor.tilt
    down = np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    told = at.output.direct[:3, at.inputs.index("gravity")]
    for b, own in enumerate(parts.blades):
        mass, first = masses(own)
        falls = into_the_blade(azimuth + 2.0 * np.pi * b / 3.0) @ down
        about_the_root = np.cross(first - mass * own.blade.position[0], falls)
        assert told[b] == pytest.approx(about_the_root[1], rel=1e-9, abs=1e-3)


def blade_signals(steps):
    """Flaps of three blades, wind and azimuths of some steps."""
    time = DT * np.arange(steps)
    phase = RNG.uniform(0.0, 6.0, (1, 7))
    signal = np.sin(time[:, None] * np.array([1.0, 2.5, 4.0, 3.0, 2.0, 5.0, 3.5]) + phase)
    return 0.1 * signal, 0.7 + CASE.rotor_speed * time


def in_components(u, azimuth):
    return np.hstack([to_components(u[:, :3], azimuth), to_components(u[:, 3:6], azimuth), u[:, 6:]])


def test_series_evaluates_to_the_steps_it_was_made_of_between_its_samples(unequal):
    parts, components = unequal
    at = azimuth_steps(
        parts, multiblade_aerodynamics(*components, CASE.rotor_speed, DT), slow_wake(parts.mean)
    )
    mean, periodic = fourier_series(at)
    u, azimuth = blade_signals(400)
    ours = simulate_periodic(mean, periodic, in_components(u, azimuth), azimuth)
    x, theirs = np.zeros(mean.order), np.empty_like(ours)
    for n, now in enumerate(in_components(u, azimuth)):
        step, forcing = at(azimuth[n])
        theirs[n] = step.C @ x + step.D @ now + forcing[len(x) :]
        x = step.A @ x + step.B @ now + forcing[: len(x)]
    np.testing.assert_allclose(
        ours / np.abs(theirs).max(axis=0), theirs / np.abs(theirs).max(axis=0), atol=1e-9
    )


def test_blades_own_frames_and_multiblade_coordinates_converge_with_the_square_of_the_step(unequal):
    """The same unequal blades, Newmark's rule in two coordinates; a lattice without memory, so that dt is free."""
    parts, components = unequal
    frozen = [replace_memory(part) for part in components]
    equations = unequal_equations(parts)
    gaps = []
    for steps in (100, 200):
        dt = 1.0 / steps
        time = dt * np.arange(steps + 1)
        turn = CASE.rotor_speed * dt
        azimuth = 0.6 + CASE.rotor_speed * time
        u = np.zeros((steps + 1, 8))
        u[:, :3] = np.outer(1.0 - np.cos(3.0 * time), [0.1, -0.05, 0.02])
        tips = []
        for form, lattice in (
            (equations, multiblade_aerodynamics(*frozen, 0.0, dt)),
            (multiblade_equations(equations), multiblade_aerodynamics(*frozen, CASE.rotor_speed, dt)),
        ):
            own = form is equations
            inputs = u if own else np.hstack([in_components(u[:, :7], azimuth), u[:, 7:]])
            x, y = None, []
            for theta, now in zip(azimuth, inputs, strict=True):
                A, B, C, D = step_matrices(form, lattice, dt, theta, turn)
                x = np.zeros(len(A)) if x is None else x
                y.append(C @ x + D @ now)
                x = A @ x + B @ now
            out = np.array(y)[:, 3:6]
            tips.append(out if own else to_blades(out, azimuth))
        gaps.append(np.abs(tips[0] - tips[1]).max())
    assert 3.5 < gaps[0] / gaps[1] < 4.5


def replace_memory(component):
    """The component's steady gains alone."""
    gain = component.transfer_function(np.ones(1, dtype=complex))[0]
    gain = gain if np.iscomplexobj(component.A) else gain.real
    ny, nu = gain.shape
    return replace(component, A=np.zeros((0, 0)), B=np.zeros((0, nu)), C=np.zeros((ny, 0)), D=gain)


def test_one_percent_on_the_third_blade_shows_as_four_thousandths_of_the_mass_matrix():
    parts, _ = assemble_unequal(coarse(mass_factor=(1.0, 1.0, 1.01)))
    by_azimuth = multiblade_equations(unequal_equations(parts))
    mass = np.stack([by_azimuth(azimuth).structure.mass for azimuth in np.linspace(0.0, 6.0, 25)])
    assert np.ptp(mass, axis=0).max() / 2.0 == pytest.approx(4e-3 * np.abs(mass).max(), rel=0.3)


@pytest.fixture(scope="module")
def dead_flap():
    return build_model(coarse(flap_effectiveness=(1.0, 1.0, 0.0)))


def test_dead_flap_is_the_time_invariant_turbine_with_that_flap_held_still(dead_flap):
    whole = build_model(coarse())
    u, azimuth = blade_signals(300)
    ours = simulate_periodic(dead_flap.turbine, dead_flap.periodic, in_components(u, azimuth), azimuth)
    u[:, [2, 5]] = 0.0
    theirs = whole.turbine.simulate(in_components(u, azimuth))
    size = np.abs(theirs).max(axis=0)
    np.testing.assert_allclose(ours / size, theirs / size, atol=1e-9)


def test_blades_of_one_other_pitch_mass_and_stiffness_are_the_turbine_made_of_them():
    """Equal factors go into turbine and pitch: no periodic form, and the same model."""
    blades = coarse(mass_factor=(1.1,) * 3, stiffness_factor=(0.9,) * 3, pitch_offset=(0.01,) * 3)
    point = replace(CASE.operating_point, pitch=0.01)
    other = replace(coarse(), turbine=CASE.turbine.with_blade(1.1, 0.9), operating_point=point)
    ours, theirs = build_model(blades), build_model(other)
    assert ours.periodic is None
    assert ours.hash == theirs.hash


@pytest.fixture(scope="module")
def heavy():
    return build_model(coarse(mass_factor=(1.0, 1.0, 1.02)))


def test_which_blade_is_the_heavy_one_is_a_matter_of_azimuth(heavy):
    other = build_model(coarse(mass_factor=(1.02, 1.0, 1.0)))
    azimuth = CASE.rotor_speed * DT * np.arange(150)
    wind = np.zeros((150, 7))
    wind[:, 6] = np.sin(3.0 * DT * np.arange(150))
    ours = simulate_periodic(other.turbine, other.periodic, wind, azimuth + 4.0 * np.pi / 3.0)
    theirs = simulate_periodic(heavy.turbine, heavy.periodic, wind, azimuth)
    size = np.abs(theirs).max(axis=0)
    np.testing.assert_allclose(ours / size, theirs / size, atol=1e-9)


def test_late_inputs_of_unequal_blades_are_those_of_the_step_before(dead_flap):
    case = coarse(flap_effectiveness=(1.0, 1.0, 0.0))
    late = build_model(replace(case, discretisation=replace(case.discretisation, input_delay=1)))
    u, azimuth = blade_signals(150)
    ours = simulate_periodic(late.turbine, late.periodic, in_components(u, azimuth), azimuth)
    u = np.vstack([np.zeros((1, 7)), u[:-1]])
    theirs = simulate_periodic(dead_flap.turbine, dead_flap.periodic, in_components(u, azimuth), azimuth)
    size = np.abs(theirs).max(axis=0)
    np.testing.assert_allclose(ours / size, theirs / size, atol=1e-9)


def test_heavy_blade_throws_the_tower_sideways_once_a_revolution(heavy):
    """The steady answer to the imbalance: a force of the surplus mass times radius times speed squared."""
    steps = round(2.0 * np.pi / (CASE.rotor_speed * DT))
    azimuth = CASE.rotor_speed * DT * np.arange(40 * steps)
    y = simulate_periodic(heavy.turbine, heavy.periodic, np.zeros((len(azimuth), 7)), azimuth)
    sway = y[-steps:, 7]
    amplitude = 2.0 * np.exp(-1j * azimuth[-steps:]) @ sway / steps
    turning = np.abs(amplitude)
    assert turning == pytest.approx(np.sqrt(2.0) * sway.std(), rel=0.02)
    # Blade: 17,740 kg with its centre 20.475 m from the root. Tower: one mode at 0.316 Hz with the top mass and a
    # share of the tower's own.
    force = 0.02 * 17740.0 * (20.475 + 1.5) * CASE.rotor_speed**2
    own, natural = 2.0 * np.pi * 0.316, CASE.rotor_speed
    mass = 240e3 + 56.78e3 + 3 * 17.74e3 + 0.24 * 347.46e3
    assert turning == pytest.approx(force / mass / (own**2 - natural**2), rel=0.15)
    # Slower than the tower, so towards the heavy blade: to the right, looking downwind, a quarter turn after its top.
    towards = 2.0 * np.exp(-1j * azimuth[-steps:]) @ -np.sin(azimuth[-steps:] + 4.0 * np.pi / 3.0) / steps
    assert abs(np.angle(amplitude / towards)) < np.radians(5.0)


def test_unequal_blades_are_stable_by_floquet_and_agree_with_the_mean_where_they_hardly_differ(dead_flap):
    multipliers = floquet_multipliers(dead_flap)
    steps = round(2.0 * np.pi / (dead_flap.rotor_speed * dead_flap.time_step))
    mean = np.abs(np.linalg.eigvals(dead_flap.turbine.A)).max() ** steps
    assert np.abs(multipliers).max() == pytest.approx(mean, rel=1e-6)
    assert np.abs(multipliers).max() < 1.0


def test_periodic_part_survives_the_file_and_says_why_it_is_there(tmp_path, dead_flap):
    save_model(dead_flap, tmp_path / "m.safetensors")
    again = load_model(tmp_path / "m.safetensors")
    assert again.hash == dead_flap.hash != load_model("nrel5mw-rated").hash
    assert "flap_effectiveness 1, 1, 0" in again.form
    ours, theirs = (system_at(m.turbine, m.periodic, 0.4) for m in (again, dead_flap))
    np.testing.assert_array_equal(ours.B, theirs.B)


def test_pitches_that_differ_are_told_in_degrees(dead_flap):
    blades = {**dead_flap.case["blades"], "pitch_offset": [0.0, 0.0, np.radians(0.3)]}
    form = replace(dead_flap, case={**dead_flap.case, "blades": blades}).form
    assert "pitch_offset 0, 0, 0.3 deg" in form


def test_matlab_file_holds_the_part_that_turns(tmp_path, dead_flap):
    save_mat(dead_flap, tmp_path / "m.mat")
    content = scipy.io.loadmat(tmp_path / "m.mat", simplify_cells=True)
    np.testing.assert_array_equal(content["periodic"]["core"], dead_flap.periodic.core)


def test_unequal_blades_are_not_reduced_once_more():
    case = coarse(mass_factor=(1.0, 1.0, 1.02))
    loose = replace(case, reduction=replace(case.reduction, coupled_tolerance=0.01))
    with pytest.raises(ValueError, match=r"reduction\.coupled_tolerance: expected 0 % with unequal blades"):
        build_model(loose)
