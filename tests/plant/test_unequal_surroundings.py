"""Fields, boxes, steady inflow, gravity and gusts by strip around unequal blades: against equal ones and marching."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.constants import g as STANDARD_GRAVITY
from scipy.integrate import cumulative_trapezoid, trapezoid

from flapgym.aeroelastic.build import build_model
from flapgym.core.multiblade import blade_azimuths, to_blades, to_components
from flapgym.model import load_model
from flapgym.model.harmonics import PeriodicPart, simulate_periodic
from flapgym.model.nameplate import nameplate
from flapgym.model.signals import grouped, strip_inputs
from flapgym.plant import GivenWind, PeriodicPlant, Surroundings
from flapgym.turbine import Signals, load_case
from flapgym.wind import Inflow
from flapgym.wind.box import WindBox
from flapgym.wind.box_field import BoxField
from flapgym.wind.turbulence import VonKarman
from tests.plant.plants import LENGTH_SCALE, actions_of, assert_near, flown, fly, plant_of, rest, start_of

SURPLUS = 0.05
"""Of blade 1's mass."""
FIELD = VonKarman(0.1, LENGTH_SCALE)
INFLOW = Inflow(shear_exponent=0.2, tower_shadow=True)
SHEAR = Inflow(shear_exponent=0.2, yaw_error=0.1)


@cache
def heavy_model():
    """Small, coarse, with winds by strip and gravity, and a heavy blade."""
    case = load_case("nrel5mw-corrected")
    return build_model(
        replace(
            case,
            airloads=replace(case.airloads, mean_wake=0.1, mean_induction=0.2),
            discretisation=replace(case.discretisation, chordwise_panels=2, wake_length=0.05, time_step=0.02),
            reduction=replace(case.reduction, blade_modes=4, tower_modes=4, aerodynamic_states=8),
            blades=replace(case.blades, mass_factor=(1.0 + SURPLUS, 1.0, 1.0)),
            signals=Signals(wind="by strip", gravity=True),
        )
    )


def equal_as_periodic():
    """The shipped model of a site, its blades' differences written down as zeros."""
    model = load_model("nrel5mw-site")
    rows = model.turbine.order + len(model.turbine.outputs)
    columns = model.turbine.order + len(model.turbine.inputs)
    part = PeriodicPart(
        left=np.zeros((rows, 1)),
        core=np.zeros((1, 1, 1), dtype=complex),
        right=np.zeros((1, columns)),
        forcing=np.zeros((2, rows), dtype=complex),
    )
    return replace(model, periodic=part)


def rough_box(seconds=60.0):
    """White noise in a box over the disk."""
    places = np.linspace(-75.0, 75.0, 11)
    u = np.random.default_rng(4).standard_normal((round(seconds / 0.5), 11, 11))
    return BoxField(WindBox(u - u.mean(), places, places, 0.5, 11.0), start=25.0)


def gust_by_strip(model, samples):
    """A wind that wanders in every component of every strip, and has blown in each before."""
    rng = np.random.default_rng(0)
    steps = rng.standard_normal((samples, 3 * model.strips)) / 50.0
    before = rng.standard_normal(3 * model.strips)
    return GivenWind(before + steps.cumsum(axis=0), before)


AROUND = {
    "field": Surroundings(field=FIELD),
    "box": Surroundings(field=rough_box()),
    "inflow": Surroundings(inflow=INFLOW),
    "gravity": Surroundings(gravity=True),
    "gust by strip": Surroundings(),
    "all": Surroundings(FIELD, INFLOW, gravity=True),
}


@pytest.mark.parametrize("name", AROUND)
def test_blades_whose_differences_are_zero_do_what_equal_blades_do_to_1e9(name):
    model, around = equal_as_periodic(), AROUND[name]
    periodic = plant_of(2, 5, 40, model, surroundings=around)
    constant = plant_of(2, 5, 40, replace(model, periodic=None), "numpy", surroundings=around)
    assert isinstance(periodic, PeriodicPlant)
    assert periodic.noise_count == constant.noise_count
    gust = gust_by_strip(model, 201) if name in ("gust by strip", "all") else None
    start, actions = start_of(constant, gust=gust), actions_of(constant, 40)
    first = [plant.reset(np.arange(2), start).last for plant in (periodic, constant)]
    for place in constant.quantities.last.values():
        assert_near(first[0][:, place], first[1][:, place], 1e-9)
    np.testing.assert_allclose(periodic.strongest_wind, constant.strongest_wind, rtol=1e-12)
    got, expected = fly(periodic, actions), fly(constant, actions)
    for quantity in constant.quantities.sample:
        assert_near(got.samples(quantity), expected.samples(quantity), 1e-9, quantity)


def test_what_is_told_of_steady_inflow_is_what_equal_blades_tell():
    model, around = equal_as_periodic(), Surroundings(inflow=INFLOW, gravity=True)
    azimuth = np.linspace(0.0, 7.0, 50)
    got = plant_of(1, 5, 4, model, surroundings=around).steady(azimuth)
    expected = plant_of(1, 5, 4, replace(model, periodic=None), "numpy", surroundings=around).steady(azimuth)
    assert got.keys() == expected.keys()
    for name, values in expected.items():
        assert_near(got[name], values, 1e-9, name)


def marched(model, inputs, azimuth, x0=None, imbalance=0.0):
    """Outputs by name, (T, 3) of the blades or (T, 1), of the model's own simulation under inputs by name."""
    u = np.zeros((len(azimuth), len(model.turbine.inputs)))
    for name, values in inputs.items():
        u[:, model.turbine.inputs.index(name)] = values
    y = simulate_periodic(model.turbine, model.periodic, u, azimuth, x0, imbalance)
    told, names = {}, model.turbine.outputs
    for base, of_blades in grouped(names):
        at = names.index(f"{base}_0" if of_blades else base)
        told[base] = to_blades(y[:, at : at + 3], azimuth) if of_blades else y[:, [at]]
    return told


def strips_of(model, winds):
    return dict(zip(strip_inputs(model.strips), np.asarray(winds).T, strict=True))


def test_the_response_to_what_is_steady_is_that_of_marching_about_each_blade_s_own_mean():
    model, run_in = heavy_model(), 600.0
    revolution = 2.0 * np.pi / model.rotor_speed
    # Whole steps a revolution, so that means over one are sums.
    steps = round(revolution / model.time_step)
    model = replace(model, rotor_speed=2.0 * np.pi / steps / model.time_step)
    azimuth = 2.0 * np.pi / steps * np.arange(round(run_in / model.time_step) // steps * steps + steps)
    disk, radii = nameplate(model.case).disk, nameplate(model.case).strip_radii
    met = [SHEAR.on_disk(radii, each, disk, model.wind_speed) for each in blade_azimuths(azimuth[:steps]).T]
    winds = to_components(np.stack(met, axis=-1), azimuth[:steps]).transpose(1, 0, 2).reshape(steps, -1)
    inputs = strips_of(model, np.tile(winds, (len(azimuth) // steps, 1)))
    expected = marched(model, inputs | {"gravity": STANDARD_GRAVITY}, azimuth)
    plant = plant_of(1, 5, 4, model, surroundings=Surroundings(inflow=SHEAR, gravity=True))
    got = plant.steady(azimuth[-steps:])
    for name, values in expected.items():
        last = values[-steps:] - values[-steps:].mean(axis=0)
        # The harmonics of the inflow leave out 1e-5 of its rms.
        assert_near(got[name].reshape(last.shape), last, 1e-5, name)


def test_an_episode_begins_and_goes_on_in_the_steady_response():
    model, around = heavy_model(), Surroundings(inflow=INFLOW, gravity=True)
    plant, still = (plant_of(2, 5, 40, model, surroundings=given) for given in (around, Surroundings()))
    start = rest(plant, azimuth=np.array([1.0, 4.0]))
    flight, alone = (flown(each, start, np.zeros((40, 2, 3))) for each in (plant, still))
    turned = model.rotor_speed * model.time_step * np.arange(1, 201)
    for turbine, begun in enumerate(start.azimuth):
        for name, values in plant.steady(begun + turned).items():
            got = (flight.samples(name) - alone.samples(name))[:, turbine]
            assert_near(got, values.reshape(got.shape), 1e-9, name)


def test_a_heavy_blade_sways_the_tower_by_its_surplus_weight_times_its_arm():
    """About the shaft once a revolution: a cantilever of the tower's data under a moment at its top, by hand."""
    model = heavy_model()
    turbine, rotor_speed = model.case["turbine"], model.rotor_speed
    tower = {name: np.array(values) for name, values in turbine["tower"].items()}
    z = np.linspace(tower["height"][0], tower["height"][-1], 2001)
    bends = (z[-1] - z) / np.interp(z, tower["height"], tower["bending_stiffness"])
    slope = cumulative_trapezoid(bends, z, initial=0.0)
    top = cumulative_trapezoid(slope, z, initial=0.0)[-1]
    stiffness = trapezoid(bends * (z[-1] - z), z) / top**2  # of the shape under a force at the top
    # NREL/TP-500-38060: a blade of 17,740 kg, its centre 20.475 m from the root; side to side the first at 0.312 Hz.
    moment = SURPLUS * 17740.0 * (20.475 + 1.5) * STANDARD_GRAVITY * np.cos(turbine["rotor"]["tilt"])
    # On its way the moment turns the rotor on the shaft's spring; about its root a blade has 11.776e6 kg m^2.
    inertia = 3.0 * 11.776e6
    moment /= 1.0 - rotor_speed**2 * inertia / turbine["drivetrain"]["torsion_spring"]
    expected = slope[-1] / top * moment / stiffness / (1.0 - (rotor_speed / (2.0 * np.pi * 0.312)) ** 2)
    azimuth = 2.0 * np.pi / 360 * np.arange(360)
    plant = plant_of(1, 5, 4, model, surroundings=Surroundings(gravity=True))
    sideways = plant.steady(azimuth)["tower_side_side"]
    once = 2.0 / 360 * np.exp(-1j * azimuth) @ sideways
    assert np.abs(once) == pytest.approx(expected, rel=0.05)
    # The blade that goes down on the right, to one who looks downwind, takes the top there.
    towards = 2.0 / 360 * np.exp(-1j * azimuth) @ -np.sin(azimuth)
    assert abs(np.angle(once / towards)) < np.radians(5.0)


def test_the_tower_of_equal_blades_does_not_sway_under_their_weight():
    plant = plant_of(1, 5, 4, equal_as_periodic(), surroundings=Surroundings(gravity=True))
    assert np.abs(plant.steady(np.linspace(0.0, 6.0, 20))["tower_side_side"]).max() < 1e-12


@pytest.mark.parametrize("around", [Surroundings(), AROUND["field"]], ids=["alone", "in a field"])
def test_a_gust_by_strip_and_a_field_do_what_the_model_s_own_simulation_says(around):
    model, count = heavy_model(), 200
    plant, twin = (plant_of(1, 5, count // 5, model, surroundings=each) for each in (around, Surroundings()))
    gust = gust_by_strip(model, count + 1)
    start = start_of(plant, angle=np.zeros((1, 3)), rate=np.zeros((1, 3)), gust=gust)
    if around.field is None:
        start = replace(start, noise=None)
    flight = flown(plant, start, np.zeros((count // 5, 1, 3)))
    still = flown(twin, rest(twin, azimuth=start.azimuth), np.zeros((count // 5, 1, 3)))
    azimuth = start.azimuth[0] + model.rotor_speed * model.time_step * np.arange(count + 1)
    system = model.turbine.select(inputs=strip_inputs(model.strips))
    x0 = np.linalg.solve(np.eye(system.order) - system.A, system.B @ gust.before)
    winds = gust.wind.copy()
    if around.field is not None:
        # The waves of the noise one by one, and the mean turbine's answer to them since ever.
        turbulence = plant._kernel.disturbance.prepared(count // 5).turbulence
        waves = turbulence.waves(start.noise[0]) * FIELD.deviation(model.wind_speed)
        waves = waves.reshape(len(waves), -1)
        ahead = np.exp(2j * np.pi * turbulence.frequencies * model.time_step)
        winds += (ahead ** np.arange(count + 1)[:, None] @ waves).real
        for step, wave in zip(ahead, waves, strict=True):
            x0 = x0 + np.linalg.solve(step * np.eye(system.order) - system.A, system.B @ wave).real
    expected = marched(model, strips_of(model, winds), azimuth, x0)
    for name, values in expected.items():
        got = (flight.samples(name) - still.samples(name))[:, 0]
        assert_near(got, values[1:], 1e-8, name)


@pytest.mark.parametrize("name", ["field", "box"])
def test_the_field_for_a_picture_is_that_of_the_episode(name):
    model = equal_as_periodic()
    plants = (
        plant_of(1, 5, 40, each, "numpy", surroundings=AROUND[name])
        for each in (model, replace(model, periodic=None))
    )
    azimuth = np.linspace(0.0, 6.0, 7)
    shown = []
    for plant in plants:
        start = rest(plant, noise=np.random.default_rng(1).standard_normal((1, plant.noise_count)))
        shown.append(plant.field(start).on_disk(1.3, 0.4, azimuth))
    np.testing.assert_allclose(shown[0], shown[1], atol=1e-12)


def test_nothing_steady_and_no_field_are_not_told_of():
    plant = plant_of(1, 5, 4, equal_as_periodic())
    with pytest.raises(ValueError, match=r"^steady: expected steady inflow or gravity around the plant"):
        plant.steady(np.zeros(1))
    with pytest.raises(ValueError, match=r"^field: expected a field around the plant"):
        plant.field(rest(plant))


def test_a_model_of_unequal_blades_without_the_inputs_is_refused():
    with pytest.raises(ValueError, match=r"^gravity: expected a model with gravity as an input"):
        plant_of(
            1, 5, 4, load_model("nrel5mw-corrected-heavy-blade"), surroundings=Surroundings(gravity=True)
        )
