"""Fields, steady inflow and gravity around a plant: against marching the turbine's state space step by step."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.constants import g as STANDARD_GRAVITY
from scipy.integrate import cumulative_trapezoid, trapezoid

from flapgym.core.multiblade import blade_azimuths, to_blades, to_components
from flapgym.model import load_model
from flapgym.model.nameplate import nameplate
from flapgym.model.signals import strip_inputs
from flapgym.model.steady import LEFT_OUT, steady_response
from flapgym.plant import Surroundings, field_response
from flapgym.plant.responses import realisation_azimuth
from flapgym.wind import Inflow
from flapgym.wind.turbulence import Kaimal, VonKarman
from tests.plant.plants import (
    BACKENDS,
    LENGTH_SCALE,
    actions_of,
    assert_near,
    flown,
    plant_of,
    rest,
    start_of,
)

RUN_IN = 600.0
"""Of a march [s]: 17 times the time constant of the slowest mode, the tower's sideways motion."""
SHEAR = Inflow(shear_exponent=0.2)
MISALIGNED = Inflow(shear_exponent=0.1, yaw_error=0.2, upflow=0.14)
TOWER = Inflow(shear_exponent=0.2, tower_shadow=True)
FIELD, KAIMAL = VonKarman(0.1, LENGTH_SCALE), Kaimal(hub_height=90.0)


@cache
def site_model():
    """The shipped model with winds by strip and gravity."""
    return load_model("nrel5mw-site")


def from_equilibrium(system, u):
    """Outputs (T, ny) under inputs (T, nu), from equilibrium with the first of them."""
    return system.simulate(u, np.linalg.solve(np.eye(system.order) - system.A, system.B @ u[0]))


def marched(inputs, winds):
    """Azimuths (T,) of a revolution and the turbine's outputs (T, ny), after the run-in; winds of azimuths (T,)."""
    model = site_model()
    before = round(RUN_IN / model.time_step)
    revolution = round(2.0 * np.pi / (model.rotor_speed * model.time_step))
    azimuth = model.rotor_speed * model.time_step * np.arange(before + revolution)
    outputs = from_equilibrium(model.turbine.select(inputs=inputs), winds(azimuth))
    return azimuth[before:], outputs[before:]


def strips_marched(inflow):
    """The same under steady inflow, each blade's on the disk itself."""
    model = site_model()
    disk, radii = nameplate(model.case).disk, nameplate(model.case).strip_radii

    def winds(azimuth):
        met = [inflow.on_disk(radii, each, disk, model.wind_speed) for each in blade_azimuths(azimuth).T]
        components = to_components(np.stack(met, axis=-1), azimuth)
        return components.transpose(1, 0, 2).reshape(len(azimuth), -1)

    return marched(strip_inputs(model.strips), winds)


def gravity_marched():
    return marched(("gravity",), lambda azimuth: np.full((len(azimuth), 1), STANDARD_GRAVITY))


def steady_of(around, azimuth):
    """Outputs (T, ny) with the mean that an episode leaves out."""
    model = site_model()
    steady = steady_response(model, around.inflow, around.gravity, model.turbine.outputs)
    return (steady.at(azimuth) + steady.mean)[:, :-1]


def assert_outputs_near(got, expected, relative):
    """Each within a share of its largest, but what is nothing beside the others: under gravity the tower stands."""
    for name, one, other in zip(site_model().turbine.outputs, got.T, expected.T, strict=True):
        if np.abs(other).max() > 1e-12:
            assert_near(one, other, relative, name)


@pytest.mark.parametrize("inflow", [SHEAR, MISALIGNED, TOWER], ids=["shear", "misaligned", "tower"])
def test_the_response_to_steady_inflow_is_that_of_marching_through_it_but_for_what_its_harmonics_leave_out(
    inflow,
):
    azimuth, expected = strips_marched(inflow)
    got = steady_of(Surroundings(inflow=inflow), azimuth)
    # The tower's acceleration is a small thing of high harmonics.
    slow = [name != "tower_top_acceleration_fore_aft" for name in site_model().turbine.outputs]
    for name, one, other, at in zip(site_model().turbine.outputs, got.T, expected.T, slow, strict=True):
        assert_near(one, other, np.sqrt(LEFT_OUT) * (1.0 if at else 50.0), name)


@pytest.mark.parametrize("inflow", [SHEAR, MISALIGNED, TOWER], ids=["shear", "misaligned", "tower"])
def test_the_response_to_the_harmonics_of_steady_inflow_is_that_of_marching_to_1e6(inflow):
    model = site_model()
    found = inflow.components(
        nameplate(model.case).strip_radii, nameplate(model.case).disk, model.wind_speed, left_out=LEFT_OUT
    )

    def winds(azimuth):
        turns = np.exp(3j * azimuth[:, None] * np.arange(len(found)))
        return (turns @ found.reshape(len(found), -1)).real

    azimuth, expected = marched(strip_inputs(model.strips), winds)
    assert_outputs_near(steady_of(Surroundings(inflow=inflow), azimuth), expected, 1e-6)


def test_the_response_to_gravity_is_that_of_marching_under_it_to_1e6():
    azimuth, expected = gravity_marched()
    assert_outputs_near(steady_of(Surroundings(gravity=True), azimuth), expected, 1e-6)


def test_what_is_steady_adds_up():
    azimuth = np.linspace(0.0, 7.0, 50)
    both = steady_of(Surroundings(inflow=TOWER, gravity=True), azimuth)
    each = steady_of(Surroundings(inflow=TOWER), azimuth) + steady_of(Surroundings(gravity=True), azimuth)
    assert_outputs_near(both, each, 1e-12)


def test_what_is_told_of_steady_inflow_has_no_mean_over_a_revolution():
    plant = plant_of(1, 5, 4, site_model(), "numpy", surroundings=Surroundings(inflow=TOWER, gravity=True))
    told = plant.steady(np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False))
    for name, values in told.items():
        assert np.abs(values.mean(axis=0)).max() < 1e-12 * np.abs(values).max(), name


def test_an_episode_tells_the_steady_response_at_its_azimuths():
    model, around = site_model(), Surroundings(inflow=TOWER, gravity=True)
    plant = plant_of(2, 5, 40, model, "numpy", surroundings=around)
    start = rest(plant, azimuth=np.array([1.0, 4.0]))
    flight = flown(plant, start, np.zeros((40, 2, 3)))
    turned = model.rotor_speed * model.time_step * np.arange(1, 201)
    for turbine, begun in enumerate(start.azimuth):
        for name, values in plant.steady(begun + turned).items():
            got = flight.samples(name)[:, turbine]
            assert_near(got, values.reshape(got.shape), 1e-9, name)


def test_the_weight_of_a_blade_swings_its_root_edgewise_by_a_cantilevers_hand_calculation():
    # The moment of the weight across the shaft, and that of the forces of inertia on the blade that sags under it: as
    # it swings once a turn and as the rotor turns, m Omega^2 u each across, and m Omega^2 x along at the arm u.
    model = site_model()
    sections = {name: np.array(each) for name, each in model.case["turbine"]["blade_sections_12"].items()}
    radius, rotor = sections["radius"], model.case["turbine"]["rotor"]
    x = np.linspace(radius[0], radius[-1], 4001)
    mass = np.interp(x, radius, sections["mass_density"])
    stiffness = np.exp(np.interp(x, radius, np.log(sections["edge_stiffness"])))

    def beyond(density):
        return trapezoid(density, x) - cumulative_trapezoid(density, x, initial=0.0)

    moment = beyond(beyond(mass * STANDARD_GRAVITY * np.cos(rotor["tilt"])))
    sag = cumulative_trapezoid(cumulative_trapezoid(moment / stiffness, x, initial=0.0), x, initial=0.0)
    expected = moment[0] + model.rotor_speed**2 * trapezoid(mass * sag * (x - 2.0 * x[0]), x)
    plant = plant_of(1, 5, 4, model, "numpy", surroundings=Surroundings(gravity=True))
    told = plant.steady(np.linspace(0.0, 2.0 * np.pi, 721))["rbm_edge"]
    assert np.abs(told).max(axis=0) == pytest.approx(np.full(3, expected), rel=0.01)


def field_plant(count, intervals=40, backend="numpy", field=FIELD, **stepping):
    around = Surroundings(field=field)
    return plant_of(count, 5, intervals, site_model(), backend, surroundings=around, **stepping)


def winds_of(turbulence, noise):
    """A period of winds by strip in components (T, 3 R) [m/s], each step the sum of its waves."""
    waves = turbulence.waves(noise) * FIELD.deviation(site_model().wind_speed)
    steps = round(turbulence.period / site_model().time_step)
    summed = np.fft.ifft(waves, steps, axis=0, norm="forward").real
    return summed.reshape(steps, -1)


def marched_in_circles(inputs, winds):
    """Outputs (T, ny) of the turbine under winds (T, nu) that repeat themselves, and always have."""
    system = site_model().turbine.select(inputs=inputs)
    state = np.zeros(system.order)
    for push in winds @ system.B.T:
        state = system.A @ state + push
    # The state a period later is that of the beginning.
    around = np.linalg.matrix_power(system.A, len(winds))
    return system.simulate(winds, np.linalg.solve(np.eye(system.order) - around, state))


def told_of(outputs, name, azimuth):
    """A quantity (T, 3) of the blades or (T, 1) of the fixed frame out of the turbine's outputs."""
    names = site_model().turbine.outputs
    if name in names:
        return outputs[:, [names.index(name)]]
    at = names.index(f"{name}_0")
    return to_blades(outputs[:, at : at + 3], azimuth)


@pytest.mark.parametrize("steps", [1, 5, 50])
def test_an_episode_in_a_field_is_that_of_marching_through_the_field_to_1e9(steps):
    model, count = site_model(), 200
    plant = plant_of(2, steps, count // steps, model, "numpy", surroundings=Surroundings(field=FIELD))
    start = start_of(plant, intensity=np.full(2, 0.03), angle=np.zeros((2, 3)), rate=np.zeros((2, 3)))
    first = plant.reset(np.arange(2), start).last
    flight = flown(plant, start, np.zeros((count // steps, 2, 3)))
    turbulence = plant._kernel.disturbance.prepared(count // steps).turbulence
    radii = nameplate(model.case).strip_radii
    annuli = radii * np.gradient(radii)
    for turbine in range(2):
        winds = winds_of(turbulence, start.noise[turbine])
        outputs = marched_in_circles(strip_inputs(model.strips), winds)[: count + 1]
        azimuth = start.azimuth[turbine] + model.rotor_speed * model.time_step * np.arange(count + 1)
        for name in (*model.blade_outputs, *model.fixed_outputs):
            expected = told_of(outputs, name, azimuth)
            assert_near(flight.samples(name)[:, turbine], expected[1:], 1e-9, name)
            assert_near(first[turbine, plant.quantities.last[name]], expected[0], 1e-9, name)
        # Of the mean over the disk there is the harmonic of the azimuth alone that stands around each ring.
        standing = start.noise[turbine].reshape(*turbulence.root.shape[:3], 2).copy()
        standing[:, 1:] = 0.0
        average = winds_of(turbulence, standing.ravel())[: count + 1, ::3] @ annuli / annuli.sum()
        assert_near(flight.samples("wind")[:, turbine, 0], average[1:], 1e-9, "wind")


def test_numpy_and_numba_tell_the_same_of_a_field_of_one_turbine_and_of_several():
    around = Surroundings(FIELD, TOWER, gravity=True)
    plants = {
        (backend, count): plant_of(count, 5, 20, site_model(), backend, surroundings=around)
        for backend in BACKENDS
        for count in (1, 3)
    }
    start, actions = start_of(plants["numpy", 3]), actions_of(plants["numpy", 3], 20)
    expected = flown(plants["numpy", 3], start, actions)
    for (backend, count), plant in plants.items():
        given = {name: value if value is None else value[:count] for name, value in vars(start).items()}
        got = flown(plant, replace(start, **given), actions[:, :count])
        for name in ("rbm", "tip_deflection", "rbm_edge", *site_model().fixed_outputs, "wind"):
            assert_near(got.samples(name), expected.samples(name)[:, :count], 1e-9, f"{name} of {backend}")


def test_a_field_that_is_the_same_over_the_disk_does_what_the_homogeneous_wind_does_to_1e9(monkeypatch):
    def the_same_everywhere(*given):
        turbulence = blade_turbulence(*given)
        root = np.zeros(turbulence.root.shape)
        root[:, 0] = turbulence.root[:, 0, :1, :1]
        return replace(turbulence, root=root)

    blade_turbulence = field_response.blade_turbulence
    monkeypatch.setattr(field_response, "blade_turbulence", the_same_everywhere)
    # A copy, for which nothing is prepared yet.
    response = replace(field_plant(1)._kernel.disturbance)
    synthesis = response.prepared(40)
    noise = np.random.default_rng(3).standard_normal(synthesis.turbulence.noise_count)
    expected = marched_in_circles(["wind"], winds_of(synthesis.turbulence, noise)[:, :1])
    got = synthesis.outputs(noise, 200)
    for name, one in zip(response.modal.outputs[:-1], got.T, strict=False):
        other = expected[:200, site_model().turbine.outputs.index(name)]
        # Of outputs that nothing moves, as the rotor is symmetric, there is round-off alone.
        assert_near(one, other, 1e-9 if np.abs(other).max() > 1e-12 else np.inf, name)


@pytest.mark.parametrize("field", [FIELD, KAIMAL], ids=["von_karman", "kaimal"])
def test_the_same_seed_meets_the_same_field_however_long_actions_are_held(field):
    seconds = 20.0 / site_model().time_step
    found = []
    for steps in (1, 5, 50):
        intervals = int(np.ceil(seconds / steps))
        plant = plant_of(1, steps, intervals, site_model(), "numpy", surroundings=Surroundings(field=field))
        synthesis = plant._kernel.disturbance.prepared(intervals)
        noise = np.random.default_rng(8).standard_normal(plant.noise_count)
        found.append(synthesis.outputs(noise, 2850))
    for other in found[1:]:
        assert_near(other, found[0], 1e-12)


def test_a_single_blade_is_refused_as_it_does_not_turn():
    with pytest.raises(ValueError, match=r"^surroundings: expected none with the single blade"):
        field_plant(1, single_blade=True)


def test_a_model_whose_steps_are_longer_than_half_a_wave_of_the_field_is_refused():
    response = field_plant(1)._kernel.disturbance
    slow = replace(
        response, modal=replace(response.modal, time_step=0.2), turn=0.2 * site_model().rotor_speed
    )
    with pytest.raises(ValueError, match=r"^field\.time_step: expected 0 s < time < 0\.156.* s, got 0\.2 s$"):
        slow.prepared(40)


def test_an_episode_in_a_field_begins_as_lively_as_it_ends():
    # Against the mean square of the last two seconds, within four standard errors of their difference.
    count, seconds = 100, round(2.0 / site_model().time_step)
    plant = plant_of(
        count,
        50,
        60,
        site_model(),
        "numpy",
        pool=count,
        surroundings=Surroundings(field=FIELD),
    )
    start = rest(plant, realisation=np.arange(count), azimuth=realisation_azimuth(np.arange(count)))
    flight = flown(plant, start, np.zeros((60, count, 3)))
    for name in ("rbm", "tip_deflection", "rbm_edge", *site_model().fixed_outputs):
        square = flight.samples(name) ** 2
        first, last = (part.mean(axis=(0, 2)) for part in (square[:seconds], square[-seconds:]))
        error = np.std(first - last, ddof=1) / np.sqrt(count)
        assert abs(first.mean() - last.mean()) < 4.0 * error, name
