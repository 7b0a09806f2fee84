"""The built model against the unreduced physics, by frequency: full lattice, all blade modes, marched wake."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aerodynamics import march
from flapgym.aerodynamics.downwash import glauert_scale
from flapgym.aeroelastic.blade_lattice import blade_lattice, reduce_component
from flapgym.aeroelastic.build import STAGES, build_model, open_loop_rms
from flapgym.aeroelastic.coupling import multiblade_aerodynamics
from flapgym.aeroelastic.equations import Parts, turbine_equations
from flapgym.aeroelastic.trim import trim
from flapgym.core.multiblade import to_blades, to_components
from flapgym.model import TurbineModel, load_model
from flapgym.model.reduced import activity
from flapgym.reduction import normal_modes, relative_error
from flapgym.structure import linear_support
from flapgym.turbine import load_case
from flapgym.wind import von_karman_spectrum
from reference.exact import harmonic_response

CASE = load_case("nrel5mw-rated")
DT = CASE.discretisation.time_step
FREQUENCY = np.array([0.005, 0.02, 0.1, 0.2, 0.32, 0.5, 0.7, 1.0, 1.5])


@pytest.fixture(scope="module")
def rebuilt() -> TurbineModel:
    stages: list[str] = []
    model = build_model(CASE, stages.append)
    assert tuple(stages) == STAGES
    return model


@pytest.fixture(scope="module")
def rotor():
    balance = trim(CASE)
    return balance.blade, balance.rotor


def exact_response(rotor, modes):
    """Coupled response (nf, outputs, inputs) with the lattice's own transfer function, no reduced state."""
    blade, aero = rotor
    frequency, shape = normal_modes(blade.mass, blade.stiffness, modes)
    lattice = blade_lattice(CASE, aero, blade, shape)
    support = linear_support(CASE.turbine, CASE.rotor_speed)
    equations = turbine_equations(Parts(CASE, blade, support, frequency, shape, lattice))
    return harmonic_response(equations, aero, lattice, FREQUENCY, CASE.rotor_speed)


def channel_error(ours, exact):
    """Error of every channel over frequency in rms, relative to the largest channel of its output and kind of input.

    Kinds are flap angles, flap rates and wind: a small cross channel counts by what it adds to the large ones.
    """
    error, size = (np.sqrt((np.abs(part) ** 2).mean(axis=0)) for part in (ours - exact, exact))
    kinds = [slice(0, 3), slice(3, 6), slice(6, 7)]
    blades = [slice(0, 3), slice(3, 6), slice(6, 7), slice(7, 8)]
    return np.array([[error[y, u].max() / size[y, u].max() for u in kinds] for y in blades])


def test_reducing_the_lattice_to_150_states_keeps_moment_tip_and_fore_aft_to_a_quarter_percent_below_1_5_hz(
    rotor,
):
    ours = load_model("nrel5mw-rated").turbine.frequency_response(FREQUENCY)
    exact = exact_response(rotor, CASE.reduction.blade_modes)
    error = channel_error(ours, exact)
    assert error[:3].max() < 2.5e-3
    assert error[3].max() < 1e-2  # side to side, which in-plane loads drive


def test_thirteen_blade_modes_leave_two_percent_of_all_seventy_two_below_1_5_hz(rotor):
    few = exact_response(rotor, CASE.reduction.blade_modes)
    all_modes = exact_response(rotor, 72)
    assert channel_error(few, all_modes).max() < 2e-2


def test_reduced_rotor_follows_the_marched_wake_when_one_flap_steps(rotor):
    """One blade alone excites every cyclic component: a wrong whirl sign shows on its neighbours."""
    blade, aero = rotor
    _, shape = normal_modes(blade.mass, blade.stiffness, 2)
    lattice = blade_lattice(CASE, aero, blade, shape)
    collective, whirl = (reduce_component(aero, lattice, m, 50) for m in (0, 1))
    reduced = multiblade_aerodynamics(collective, whirl, CASE.rotor_speed, DT)
    steps, nu = 500, lattice.downwash.shape[1]
    flap = lattice.select("flap_angle")[:, 0]
    _, force = march(aero, np.tile(np.outer([1.0, 0.0, 0.0], lattice.downwash @ flap), (steps, 1, 1)))
    marched = force.reshape(steps, 3, -1) @ lattice.load.T

    azimuth = 0.3 + CASE.rotor_speed * DT * np.arange(steps)
    x, ours = np.zeros(reduced.A.shape[0]), []
    for theta in azimuth:
        u = np.kron(to_components(np.array([1.0, 0.0, 0.0]), theta), flap)
        y = (reduced.C @ x + reduced.D @ u).reshape(3, -1)
        ours.append(to_blades(y.T, theta).T)
        x = reduced.A @ x + reduced.B @ u
    assert nu == lattice.downwash.shape[1]
    moment = lattice.modes + 4  # about y at the apex
    error = np.abs(np.array(ours)[:, :, moment] - marched[:, :, moment]).max(axis=0)
    assert error[0] < 2e-3 * np.abs(marched[:, 0, moment]).max()
    assert (error[1:] < 2e-3 * np.abs(marched[:, 0, moment]).max()).all()
    assert (np.abs(marched[-1, 1:, moment]) > 10.0 * error[1:]).all()  # the neighbours' share is resolved


def test_shipped_model_is_what_the_case_builds(rebuilt):
    shipped = load_model("nrel5mw-rated")
    assert shipped.inputs_hash == rebuilt.inputs_hash == CASE.hash()
    assert shipped.hash == rebuilt.hash
    for name in ("turbine", "blade"):
        ours, theirs = (getattr(m, name).frequency_response(FREQUENCY) for m in (shipped, rebuilt))
        scale = np.abs(theirs).max(axis=(0, 2))[None, :, None]
        np.testing.assert_allclose(ours / scale, theirs / scale, atol=1e-6)


def test_coupled_models_are_stable_and_of_the_order_counted(rebuilt):
    modes = 2 * (3 * CASE.reduction.blade_modes + CASE.reduction.tower_modes)
    assert rebuilt.turbine.order == modes + 3 * CASE.reduction.aerodynamic_states
    assert rebuilt.turbine.spectral_radius() < 1.0
    assert rebuilt.blade.spectral_radius() < 1.0


def test_open_loop_rms_is_the_spectrum_through_the_frequency_response(rebuilt):
    """Integral of |H|^2 S over frequency with the analytic von Karman spectrum."""
    frequency = np.geomspace(1e-4, 20.0, 3000)
    response = rebuilt.turbine.select(inputs=["wind"], outputs=["rbm_0", "rbm_c", "rbm_s"])
    gain = np.abs(response.frequency_response(frequency)[:, :, 0]) ** 2 @ [1.0, 0.5, 0.5]
    spectrum = von_karman_spectrum(frequency, 11.0, 0.10, 147.0)
    rms = np.sqrt(np.trapezoid(gain * spectrum, frequency) + gain[0] * spectrum[0] * frequency[0])
    assert open_loop_rms(CASE, rebuilt.turbine) == pytest.approx(rms, rel=5e-3)


def coarse(**changes):
    """A small case, quick to build, with a change of its discretisation or reduction."""
    grid = replace(CASE.discretisation, chordwise_panels=3, wake_length=0.1)
    reduction = replace(CASE.reduction, blade_modes=4, tower_modes=4, aerodynamic_states=15)
    for key, value in changes.items():
        if hasattr(grid, key):
            grid = replace(grid, **{key: value})
        else:
            reduction = replace(reduction, **{key: value})
    return replace(CASE, discretisation=grid, reduction=reduction)


@pytest.fixture(scope="module")
def small():
    return build_model(coarse())


def test_halving_the_flap_halves_its_gain_and_changes_the_hash(small):
    case = coarse()
    share = 0.5 * glauert_scale(case.discretisation.chordwise_panels, case.flaps[0].chord_fraction)
    halved = build_model(replace(case, flaps=(replace(case.flaps[0], effectiveness=share),)))
    columns = [name for name in small.turbine.inputs if name != "wind"]
    half, whole = (m.turbine.select(inputs=columns).dc_gain() for m in (halved, small))
    size = np.abs(whole).max(axis=1, keepdims=True)
    np.testing.assert_allclose(half / size, 0.5 * whole / size, atol=1e-3)
    assert halved.hash != small.hash
    assert halved.inputs_hash != small.inputs_hash


def test_one_step_delay_lets_the_blades_feel_flap_and_gust_a_step_late(small):
    """Blade by blade: the rotor turns on during the step, the flap stays on its blade."""
    late = build_model(coarse(input_delay=1))
    azimuth = 0.4 + CASE.rotor_speed * DT * np.arange(80)
    rng = np.random.default_rng(6)
    flap, rate, wind = (rng.standard_normal((80, k)) for k in (3, 3, 1))

    def run(model, by):
        parts = [np.roll(part, by, axis=0) for part in (flap, rate, wind)]
        for part in parts:
            part[:by] = 0.0
        u = np.hstack([to_components(parts[0], azimuth), to_components(parts[1], azimuth), parts[2]])
        return model.turbine.simulate(u)

    np.testing.assert_allclose(
        run(late, 0), run(small, 1), rtol=1e-7, atol=1e-7 * np.abs(run(small, 1)).max()
    )


def test_convected_gust_acts_later_and_weaker_at_high_frequency_and_alike_when_steady(small):
    convected = build_model(coarse(gust="convected"))
    wind = [m.turbine.select(inputs=["wind"], outputs=["rbm_0"]) for m in (small, convected)]
    np.testing.assert_allclose(wind[1].dc_gain(), wind[0].dc_gain(), rtol=1e-6)
    at_once, along = (abs(system.frequency_response([5.0])[0, 0, 0]) for system in wind)
    assert along < 0.8 * at_once


def test_coupled_tolerance_shrinks_the_turbine_and_is_kept(small):
    reduced = build_model(coarse(coupled_tolerance=1e-2))
    assert reduced.turbine.order < small.turbine.order
    weight = activity(small)
    assert relative_error(small.turbine, reduced.turbine, weight).max() <= 1e-2


def test_aerodynamic_tolerance_drops_the_states_the_singular_values_call_small(small):
    loose = build_model(coarse(aerodynamic_tolerance=0.05))
    assert loose.turbine.order < small.turbine.order
    wind = [m.turbine.select(inputs=["wind"], outputs=["rbm_0"]) for m in (small, loose)]
    np.testing.assert_allclose(wind[1].dc_gain(), wind[0].dc_gain(), rtol=1e-6)


@pytest.mark.parametrize(
    "point",
    [{"wind_speed": 5.0}, {"wind_speed": 8.0, "tip_speed_ratio": 8.0}, {"pitch": 0.05}],
    ids=["light wind", "faster rotor", "pitched"],
)
def test_other_operating_points_build_stable_models_that_gust_and_flap_load(point):
    case = coarse()
    model = build_model(replace(case, operating_point=replace(case.operating_point, **point)))
    gain = model.turbine.dc_gain()
    assert gain[0, 0] > 0.0
    assert gain[0, 6] > 0.0


def test_wider_and_deeper_flap_loads_the_blade_more_at_any_time_step(small):
    case = coarse(time_step=0.012)
    model = build_model(replace(case, flaps=(replace(case.flaps[0], span_start=0.5, chord_fraction=0.35),)))
    assert model.time_step == 0.012
    ours, theirs = (m.turbine.dc_gain()[0] for m in (model, small))
    assert ours[0] > 1.5 * theirs[0]  # flap
    assert ours[6] == pytest.approx(theirs[6], rel=0.02)  # wind


def test_above_rated_wind_with_its_pitch_builds_a_stable_model():
    point = replace(CASE.operating_point, wind_speed=15.0, tip_speed_ratio=5.32, pitch=0.182)
    model = build_model(replace(coarse(), operating_point=point))
    assert model.turbine.spectral_radius() < 1.0
    assert model.turbine.dc_gain()[0, 6] > 0.0
    errors = model.record.errors
    assert set(errors) == {"lattice reduced, collective", "lattice reduced, whirl"}
    assert max(errors.values()) < 0.2


def test_strong_wind_with_too_little_pitch_is_refused_with_the_fields_to_change():
    point = replace(CASE.operating_point, wind_speed=15.0, pitch=0.01)
    with pytest.raises(
        ValueError, match=r"operating_point: .*unstable.* at 15 m/s, .*0\.57.* deg of pitch; .*pitched"
    ):
        build_model(replace(coarse(), operating_point=point))


def test_documented_stations_build_nearly_the_same_turbine(small):
    fine = build_model(coarse(blade_elements=48, first_lattice_node=11))
    ours, theirs = (m.turbine.dc_gain()[[0, 3]][:, [0, 6]] for m in (fine, small))
    np.testing.assert_allclose(ours, theirs, rtol=0.1)


def test_balance_that_does_not_exist_names_the_operating_point():
    case = coarse()
    storm = replace(case.operating_point, wind_speed=25.0, tip_speed_ratio=12.0, pitch=1e-9)
    with pytest.raises(ValueError, match=r"operating_point: .*lower wind_speed or tip_speed_ratio"):
        build_model(replace(case, operating_point=storm))


def test_flap_too_small_for_the_lattice_is_named():
    case = coarse()
    with pytest.raises(ValueError, match=r"flap: the lattice resolves no flap from span_start 0\.7"):
        build_model(replace(case, flaps=(replace(case.flaps[0], span_end=0.7 + 1e-12),)))
