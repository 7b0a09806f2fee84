"""Pitch of each blade as an input: against rigid bodies, the non-linear beam and the trim at another pitch."""

from dataclasses import replace

import numpy as np
import pytest

import flapgym.aerodynamics.steady as steady_loads
from flapgym.aerodynamics import pitch_transport
from flapgym.aerodynamics.response import steady_response
from flapgym.aeroelastic.blade_lattice import BladeLattice
from flapgym.aeroelastic.build import assemble_parts, build_model, slow_wake
from flapgym.aeroelastic.equations import Parts, turbine_equations
from flapgym.aeroelastic.trim import trim
from flapgym.model import load_model, pitch_inputs, save_model
from flapgym.reduction import normal_modes
from flapgym.structure import Beam, Configuration, linear_blade, linear_support
from flapgym.structure.beam import internal_force
from flapgym.structure.blade import blade_beam
from flapgym.structure.inertia import distribution
from flapgym.structure.rotation import about_x, rotation_matrix
from flapgym.turbine import Case, Pitch, Signals, load_case
from tests.aeroelastic.test_signals import small

CASE = load_case("nrel5mw-rated")
CONE, MODES = CASE.turbine.rotor.precone, 72
AXIS = np.array([np.sin(CONE), 0.0, -np.cos(CONE)])  # positive with the leading edge, at -y, upwind
ACTUATOR = Pitch(angle_limit=0.2, rate_limit=0.14, natural_frequency=0.5, damping=0.7)
OUTPUTS = ("rbm_edge", "root_torsion", "tip_in_plane", "flapwise_moment_50", "deflection_50")
AXES = {
    "rbm_0": np.array([0.0, 1.0, 0.0]),
    "rbm_edge_0": np.array([np.cos(CONE), 0.0, np.sin(CONE)]),
    "root_torsion_0": np.array([-np.sin(CONE), 0.0, np.cos(CONE)]),
}


def steady_load(angle=0.0):
    """Nodal loads (13, 6) that bend the blade by some metres, carried along as it is pitched."""
    load = np.tile([8e3, -1e3, 0.0, 0.0, 0.0, 200.0], (13, 1))
    load[0] = 0.0
    return (load.reshape(-1, 3) @ rotation_matrix(angle * AXIS).T).reshape(13, 6)


@pytest.fixture(scope="module")
def without_air():
    """All modes of a bent blade, and a lattice that does nothing."""
    case = replace(CASE, signals=Signals(outputs=OUTPUTS, pitch=True), pitch=ACTUATOR)
    blade = linear_blade(case.turbine, 12, case.rotor_speed, load=steady_load())
    frequency, shape = normal_modes(blade.mass, blade.stiffness, MODES)
    nothing = BladeLattice(np.zeros((11, 2 * MODES + 11)), np.zeros((MODES + 7, 3)), MODES, flaps=1, strips=1)
    return Parts(case, blade, linear_support(case.turbine, case.rotor_speed), frequency, shape, nothing)


def told(equations, y):
    return dict(zip(equations.outputs, y, strict=True))


@pytest.mark.parametrize("power, kind", [(0, "angle"), (1, "rate"), (2, "acceleration")])
def test_rigid_blade_s_root_moments_follow_from_the_motion_of_its_masses(power, kind):
    """Masses on circles about the shaft while they turn about the pitch axis, differenced twice in time."""
    case = replace(CASE, signals=Signals(outputs=OUTPUTS, pitch=True), pitch=ACTUATOR)
    blade = linear_blade(case.turbine, 12, case.rotor_speed)
    shape = np.eye(MODES)
    nothing = BladeLattice(np.zeros((1, 2 * MODES + 11)), np.zeros((MODES + 7, 3)), MODES, flaps=1, strips=1)
    parts = Parts(case, blade, linear_support(case.turbine), np.ones(MODES), shape, nothing)
    equations = turbine_equations(parts)
    ours = told(equations, equations.output.direct[:, equations.inputs.index(f"pitch_{kind}_0")])

    directors = np.swapaxes(blade.orientation, 1, 2)
    masses = np.concatenate([blade.position[:, None], directors], axis=1).reshape(-1, 3)
    weights, small_angle, dt = distribution(blade_beam(case.turbine, 12)), 1e-4, 2e-3

    def inertia(size):
        """Force and moment about the root that the motion calls for, in axes that do not pitch."""

        def at(time):
            angle = size * time**power / (1.0, 1.0, 2.0)[power]
            return masses @ (about_x(case.rotor_speed * time) @ rotation_matrix(angle * AXIS)).T

        acceleration = (at(dt) - 2.0 * at(0.0) + at(-dt)) / dt**2
        position, momentum_rate = at(0.0), weights @ acceleration
        force = momentum_rate[::4].sum(axis=0)
        return np.cross(position, momentum_rate).sum(axis=0) - np.cross(blade.position[0], force)

    expected = -(inertia(small_angle) - inertia(-small_angle)) / (2.0 * small_angle)
    size = np.abs(expected).max()
    for name, axis in AXES.items():
        assert ours[name] == pytest.approx(axis @ expected, rel=1e-4, abs=1e-5 * size)


def test_bent_blade_turned_in_its_rotation_is_the_non_linear_beam_s_at_another_pitch(without_air):
    """Roots, tip and mid span of a loaded blade that turns with the rotor; hub held."""
    parts, h = without_air, 1e-3
    equations, column = turbine_equations(parts), 7
    assert equations.inputs[column] == "pitch_angle_0"
    a = np.zeros(len(equations.structure.mass))
    block = slice(0, MODES)
    a[block] = np.linalg.solve(equations.structure.stiffness[block, block], equations.forcing[block, column])
    ours = told(equations, equations.output.position @ a + equations.output.direct[:, column])

    def there(angle):
        beam = blade_beam(parts.case.turbine, 12, angle)
        load = steady_load(angle)
        blade = linear_blade(parts.case.turbine, 12, parts.case.rotor_speed, angle, load)
        outer = Beam(
            Configuration(beam.reference.position[6:], beam.reference.orientation[6:]),
            beam.stiffness[6:],
            beam.mass[6:],
        )
        reaction = internal_force(outer, Configuration(blade.position[6:], blade.orientation[6:]))[0]
        moved = {name: -(axis @ blade.root_load[3:]) for name, axis in AXES.items()}
        moved |= {
            "tip_deflection_0": AXES["rbm_edge_0"] @ blade.position[-1],
            "tip_in_plane_0": -blade.position[-1, 1],
        }
        moved |= {
            "deflection_50_0": AXES["rbm_edge_0"] @ blade.position[6],
            "flapwise_moment_50_0": -reaction[4],
        }
        return moved

    ahead, behind = there(h), there(-h)
    for name, value in ahead.items():
        expected = (value - behind[name]) / (2.0 * h)
        assert ours[name] == pytest.approx(expected, rel=1e-4)


def with_air(linearisation="full"):
    """One steady lattice for the mean state and the perturbations, a tower that stands still, a coarse lattice."""
    case = load_case("nrel5mw-corrected")
    tower = case.turbine.tower
    stiff = replace(
        tower,
        bending_stiffness=1e6 * tower.bending_stiffness,
        torsion_stiffness=1e6 * tower.torsion_stiffness,
    )
    return replace(
        case,
        turbine=replace(case.turbine, tower=stiff),
        airloads=replace(
            case.airloads,
            linearisation=linearisation,
            mean_wake="perturbations",
            lift_slope="thin aerofoil",
            profile="none",
        ),
        discretisation=replace(case.discretisation, chordwise_panels=3, time_step=0.0233, wake_length=0.1),
        reduction=replace(case.reduction, blade_modes=40),
        signals=Signals(outputs=("rbm_edge", "tip_in_plane", "rotor_thrust", "shaft_torque"), pitch=True),
        pitch=ACTUATOR,
    )


def static(case):
    """Static outputs per radian of collective pitch with every circulation, and with the states of a moving wake."""
    parts, rotor = assemble_parts(case)
    equations, lattice = turbine_equations(parts), parts.lattice
    one = steady_response(rotor, lattice.downwash, lattice.load, lattice.full)
    loads = np.zeros((3 * one.shape[0], 3 * one.shape[1]))
    loads[: one.shape[0], : one.shape[1]] = one
    structure, asks, read = equations.structure, equations.lattice_input, equations.output
    column = equations.inputs.index("pitch_angle_0")
    asked = asks.exogenous @ slow_wake(parts).dc_gain()[:, column]
    stiffness = structure.stiffness - structure.work @ loads @ asks.position
    d = np.linalg.solve(stiffness, structure.work @ loads @ asked + equations.forcing[:, column])
    y = read.position @ d + read.load @ loads @ (asks.position @ d + asked) + read.direct[:, column]
    return told(equations, y)


def between_trims(case, half):
    """The same per radian from trims at two pitches, half the way to either side."""

    def at(pitch):
        blade = trim(replace(case, operating_point=replace(case.operating_point, pitch=pitch))).blade
        moments = {name: -(axis @ blade.root_load[3:]) for name, axis in AXES.items()}
        tip = {
            "tip_deflection_0": AXES["rbm_edge_0"] @ blade.position[-1],
            "tip_in_plane_0": -blade.position[-1, 1],
        }
        return moments | tip | {"rotor_thrust": 3.0 * blade.on_hub[0], "shaft_torque": 3.0 * blade.on_hub[3]}

    ahead, behind = at(half), at(-half)
    return {name: (ahead[name] - behind[name]) / (2.0 * half) for name in ahead}


@pytest.fixture(scope="module")
def steady():
    """The fixed wake's static outputs per radian of collective pitch, and those between trims with the same wake."""
    case = with_air()
    case = replace(case, airloads=replace(case.airloads, slow_wake="frozen"))
    return static(case), between_trims(case, 2e-3)


@pytest.mark.parametrize(
    "name, within",
    [
        ("rbm_0", 0.02),
        ("rotor_thrust", 0.02),
        ("tip_deflection_0", 0.02),
        ("rbm_edge_0", 0.04),
        ("shaft_torque", 0.04),
        ("tip_in_plane_0", 0.04),
    ],
)
def test_static_loads_are_those_between_trims_at_two_pitches_but_for_induced_velocities(steady, name, within):
    """The mean induced velocities, which turn along here and stay in the trims, are some percent of pitch's effect."""
    ours, trimmed = steady
    assert ours[name] == pytest.approx(trimmed[name], rel=within)


@pytest.fixture(scope="module")
def adapted():
    """The corrected turbine's static outputs per radian, few panels along the chord, its wake that of the model."""
    case = with_air()
    own, grid = load_case("nrel5mw-corrected"), case.discretisation
    return replace(
        case,
        airloads=own.airloads,
        discretisation=replace(grid, wake_length=own.discretisation.wake_length),
        reduction=own.reduction,
    )


@pytest.fixture(scope="module")
def slow(adapted):
    return static(adapted)


@pytest.fixture(scope="module")
def retrimmed(adapted):
    """Between trims half a degree to either side, the induction of two diameters of wake settled by their thrust."""
    return between_trims(adapted, np.radians(0.5))


@pytest.fixture(scope="module")
def retrimmed_without_change_of_drag(adapted):
    """The same with the sections' coefficients of drag and moment held, as the perturbations hold them."""
    balance = trim(adapted)
    held = steady_loads.sections(adapted, balance.mean, balance.loads.circulation)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steady_loads, "sections", lambda *_: held)
        return between_trims(adapted, np.radians(0.5))


@pytest.mark.parametrize("name", ["rbm_0", "rotor_thrust"])
def test_pitch_held_for_long_has_the_loads_of_trims_whose_wake_follows_the_thrust(slow, retrimmed, name):
    assert slow[name] == pytest.approx(retrimmed[name], rel=0.05)


@pytest.mark.parametrize("name", ["rbm_0", "rotor_thrust", "rbm_edge_0", "shaft_torque"])
def test_in_plane_loads_of_such_trims_follow_but_for_the_sections_drag(
    slow, retrimmed_without_change_of_drag, name
):
    assert slow[name] == pytest.approx(retrimmed_without_change_of_drag[name], rel=0.05)


def test_shipped_model_has_the_moment_of_such_trims(retrimmed):
    turbine = load_model("nrel5mw-site").turbine.select(inputs=["pitch_angle_0"], outputs=["rbm_0"])
    assert turbine.dc_gain().item() == pytest.approx(retrimmed["rbm_0"], rel=0.05)


def test_leading_edge_upwind_takes_load_off_the_blades(steady):
    ours, _ = steady
    assert max(ours[name] for name in ("rbm_0", "rotor_thrust", "shaft_torque", "tip_deflection_0")) < 0.0


@pytest.fixture(scope="module")
def model():
    case = small(outputs=("rbm_edge",))
    return build_model(replace(case, signals=replace(case.signals, pitch=True), pitch=ACTUATOR))


def test_pitch_costs_one_slow_state_and_leaves_all_else_as_it_is(model, tmp_path):
    plain, ours = build_model(small(outputs=("rbm_edge",))).turbine, model.turbine
    assert ours.inputs == (*plain.inputs, *pitch_inputs())
    assert ours.order == plain.order + 1
    frequency = np.geomspace(1e-3, 5.0, 12)
    given, wanted = ours.frequency_response(frequency)[:, :, :-9], plain.frequency_response(frequency)
    np.testing.assert_allclose(given, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())
    save_model(model, tmp_path / "pitched.safetensors")
    read = load_model(tmp_path / "pitched.safetensors")
    assert read.turbine.inputs == ours.inputs
    assert read.pitch_actuator == model.pitch_actuator == ACTUATOR
    assert load_model().pitch_actuator is None


@pytest.fixture(scope="module")
def frozen():
    """The model's twin whose wake stays as it is."""
    case = small(outputs=("rbm_edge",))
    return build_model(
        replace(
            case,
            airloads=replace(case.airloads, slow_wake="frozen"),
            signals=replace(case.signals, pitch=True),
            pitch=ACTUATOR,
        )
    )


def pitched(model, frequency):
    """Response (nf, ny) of a model to its collective pitch."""
    return model.turbine.select(inputs=["pitch_angle_0"]).frequency_response(frequency)[:, :, 0]


def test_what_pitch_makes_of_the_wake_is_felt_as_wind_behind_a_lag(model, frozen):
    """The two models' difference, by the lag's own formula for inputs that are held linear between steps."""
    parts, _ = assemble_parts(Case.from_dict(model.case))
    state = pitch_transport(parts.case, parts.flow)
    frequency = np.array([1e-3, 0.01, 0.05, 0.2])
    wind = frozen.turbine.select(inputs=["wind"]).frequency_response(frequency)[:, :, 0]
    lag = 1.0 / (1.0 + 2j * np.pi * frequency * state.time_constant)
    expected = state.gain * lag[:, None] * wind
    difference = pitched(model, frequency) - pitched(frozen, frequency)
    size = np.abs(expected).max(axis=0, keepdims=True)
    np.testing.assert_allclose(difference / size, expected / size, atol=1e-4)


def test_pitch_once_a_revolution_and_faster_knows_little_of_it(model, frozen):
    frequency = model.rotor_speed / (2.0 * np.pi) * np.array([1.0, 2.0, 3.0, 6.0])
    ours, theirs = (np.abs(pitched(each, frequency)[:, 0]) for each in (model, frozen))
    np.testing.assert_allclose(ours, theirs, rtol=0.01)


def test_pitch_held_from_some_moment_on_takes_the_moment_to_its_static_gain(model):
    turbine = model.turbine.select(inputs=["pitch_angle_0"], outputs=["rbm_0"])
    steps = round(60.0 / model.time_step)
    moment = turbine.simulate(np.full((steps, 1), 0.01))[:, 0]
    assert moment[0] < 0.0
    assert moment[-1] == pytest.approx(0.01 * turbine.dc_gain()[0, 0], rel=1e-3)


def test_cyclic_pitch_takes_load_off_the_blade_that_has_it(model, frozen):
    """A steady cosine part, whose rate is that of a blade that goes round: of the size of a fixed wake's collective."""
    turbine, speed = model.turbine, model.rotor_speed
    gain = turbine.dc_gain()
    collective = frozen.turbine.dc_gain()[0, turbine.inputs.index("pitch_angle_0")]
    # beta_b = cos(theta_b): its rate -Omega sin, its acceleration -Omega^2 cos.
    size = {"pitch_angle_c": 1.0, "pitch_rate_s": -speed, "pitch_acceleration_c": -(speed**2)}
    cyclic = sum(value * gain[:, turbine.inputs.index(name)] for name, value in size.items())
    cosine, sine = (cyclic[turbine.outputs.index(f"rbm_{part}")] for part in ("c", "s"))
    assert cosine < 0.0
    assert 0.7 < np.hypot(cosine, sine) / abs(collective) < 1.3
    assert abs(cyclic[0]) < 0.1 * abs(collective)


def test_collective_pitch_brings_no_cyclic_loads_but_by_the_tower(model):
    gain = model.turbine.dc_gain()[:, model.turbine.inputs.index("pitch_angle_0")]
    assert np.abs(gain[1:3]).max() < 0.05 * abs(gain[0])


@pytest.mark.parametrize(
    "changes, said",
    [
        (
            {"signals": Signals(pitch=True)},
            r"pitch: expected a table \[pitch\] with signals.pitch, of angle_limit, ",
        ),
        ({"pitch": {"angle_limit": 0.1}}, "pitch.rate_limit: missing"),
        (
            {"pitch": vars(ACTUATOR) | {"damping": 0.0}},
            "pitch.damping: expected 0 < number <= 10, got 0",
        ),
        ({"pitch": vars(ACTUATOR) | {"rate_limit": "fast"}}, "pitch.rate_limit: expected an angular rate"),
    ],
)
def test_an_actuator_that_is_none_is_refused_by_its_field(changes, said):
    with pytest.raises(ValueError, match=said):
        replace(CASE, **changes)


def test_pitch_of_unequal_blades_is_refused():
    case = small(mass_factor=(1.05, 1.0, 1.0))
    with pytest.raises(ValueError, match="signals.pitch: expected false with unequal blades, got true"):
        build_model(replace(case, signals=Signals(pitch=True), pitch=ACTUATOR))
