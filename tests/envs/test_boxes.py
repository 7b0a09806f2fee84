"""Environments in a wind box from a file and in the extreme wind shear: files of known fields, and what is refused."""

from __future__ import annotations

import json
import struct
from functools import cache
from math import cos, pi, radians

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from scipy.io import netcdf_file

import flapgym.envs.turbines as turbines
from flapgym.core.multiblade import to_blades
from flapgym.model import load_model
from flapgym.model.nameplate import nameplate
from flapgym.model.signals import strip_inputs
from flapgym.wind import Wind

ID, SITE = "flapgym/NREL5MW-v1", "nrel5mw-site"
MEAN, STEP = 11.0, 0.25
PLACES = np.linspace(-65.0, 65.0, 14)
RNG = np.random.default_rng(4)
BLADES = ("rbm", "rbm_edge")
"""Of the outputs of the blades."""


@cache
def site():
    return load_model(SITE)


def hub_height():
    return nameplate(site().case).hub_height


def netcdf(path, wind, time_step=STEP, places=PLACES, above=0.0):
    """A classic file of a wind (T, Y, Z) [m/s] at places about the hub or a point so much above it."""
    hub = hub_height() + above
    axes = {"time": (time_step * np.arange(len(wind)), "s"), "y": (places, "m"), "z": (hub + places, "m")}
    with netcdf_file(path, "w") as file:
        for name, (values, unit) in axes.items():
            file.createDimension(name, len(values))
            variable = file.createVariable(name, "f8", (name,))
            variable[:], variable.units = values, unit
        variable = file.createVariable("u", "f8", ("time", "y", "z"))
        variable[:], variable.units = wind, "m s-1"
    return str(path)


def bts(path, wind, time_step=STEP, places=PLACES, mean=MEAN):
    """A file of TurbSim's; its whole numbers are steps of 1/1000 m/s."""
    count, spacing = len(places), places[1] - places[0]
    text = b"by hand"
    head = struct.pack("<h4l", 7, count, count, 0, len(wind))
    head += struct.pack("<6f", spacing, spacing, time_step, mean, hub_height(), hub_height() + places[0])
    head += struct.pack("<6f", 1000.0, 0.0, 1000.0, 0.0, 1000.0, 0.0) + struct.pack("<l", len(text)) + text
    body = np.zeros((len(wind), count, count, 3), dtype="<i2")
    body[..., 0] = np.rint(1000.0 * wind).transpose(0, 2, 1)
    path.write_bytes(head + body.tobytes())
    return str(path)


def hawc2(path, perturbation):
    """One component (T, Y, Z), of which the plane that arrives first stands last."""
    path.write_bytes(perturbation[::-1].astype("<f4").tobytes())
    return str(path)


def rough(seconds, deviation=1.0):
    """A wind that differs from point to point, with the mean taken off each."""
    wind = RNG.normal(0.0, deviation, (round(seconds / STEP) + 1, len(PLACES), len(PLACES)))
    return MEAN + wind - wind.mean(axis=0)


def made(file=None, wind=None, make=gymnasium.make, **given):
    """An environment in a box, or in another wind."""
    entries = {"file", "shape", "spacing", "start", "turbulence_intensity", "hub_height"} & set(given)
    box = {"kind": "box", "file": file} | {name: given.pop(name) for name in entries}
    wind = {"field": box} if wind is None else wind
    return make(ID, **{"model": SITE, "backend": "numpy", "duration": 1.4, "wind": wind} | given)


def samples(env, seed=0, options=None):
    """Every sample of an episode with flaps at rest, and the azimuth at its start."""
    _, info = env.reset(seed=seed, options=options)
    told, still, over = [], np.zeros(env.action_space.shape, dtype=np.float32), False
    azimuth = info["azimuth"]
    while not over:
        *_, over, info = env.step(still)
        told.append(info["samples"])
    return {name: np.concatenate([each[name] for each in told]) for name in told[0]}, azimuth


def assert_near(got, expected, relative, name):
    size = np.abs(expected).max()
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=relative * size, err_msg=name)


def azimuths(begun, count):
    """Of blade 1 at samples 1, 2, ... [rad]."""
    return begun + site().rotor_speed * site().time_step * np.arange(1, count + 1)


# A known field -------------------------------------------------------------------------------------------------------

FREQUENCY, UNIFORM, LEFT, UP, SADDLE = 0.31, 0.8, 0.012, -0.02, 2e-4
LONG, STEPS = 700.0, 50
"""Of an episode [s]: 20 time constants of the slowest mode, the tower's sideways motion; of an action."""


@pytest.fixture(scope="module")
def swinging(tmp_path_factory):
    """A file of (a + b y + c z) sin(2 pi f t) + d y z with a plane at every step of the model.

    Interpolation leaves it alone: it is bilinear over the disk.
    """
    dt, places = site().time_step, np.array([-65.0, 65.0])
    time = dt * np.arange(round(LONG / dt) + STEPS)
    over_disk = UNIFORM + LEFT * places[:, None] + UP * places
    wind = (
        MEAN
        + np.sin(2.0 * pi * FREQUENCY * time)[:, None, None] * over_disk
        + SADDLE * np.outer(places, places)
    )
    return netcdf(tmp_path_factory.mktemp("box") / "swinging.nc", wind, dt, places)


@pytest.fixture(scope="module")
def swung(swinging):
    env = made(
        swinging, start=0.0, duration=LONG, steps_per_action=STEPS, record_samples=True, full_info=True
    )
    return samples(env, options={"azimuth": 1.0})


def test_the_wind_of_a_known_field_is_its_mean_over_the_disk(swung):
    # y, z and y z have none.
    told = swung[0]["wind"]
    time = site().time_step * np.arange(1, len(told) + 1)
    assert_near(np.ravel(told), UNIFORM * np.sin(2.0 * pi * FREQUENCY * time), 1e-9, "wind")


@pytest.mark.parametrize("name", BLADES)
def test_the_moments_in_a_known_field_are_the_model_s_frequency_response_times_its_strips_winds(swung, name):
    # A blade's point is at y = -r sin(theta), z = r cos(theta): components a, c r, -b r that swing and do not turn, and
    # y z = -r^2 sin(2 theta_b) / 2, with sin(2 theta_b) = sin(3 theta) cos(theta_b) - cos(3 theta) sin(theta_b).
    model, (told, begun) = site(), swung
    radii, nothing = nameplate(model.case).strip_radii, np.zeros(model.strips)
    half = 0.5 * SADDLE * radii**2
    swinging = np.stack([nothing + UNIFORM, UP * radii, -LEFT * radii], axis=1)
    turning = np.stack([nothing, -half, 1j * half], axis=1) * np.exp(3j * begun)
    system = model.turbine.select(inputs=strip_inputs(model.strips))
    at, count, components = system.outputs.index(f"{name}_0"), len(told[name]), 0.0
    for rate, strips in (
        (2.0 * pi * FREQUENCY, swinging.ravel()),
        (3.0 * model.rotor_speed, turning.ravel()),
    ):
        turn = np.exp(1j * rate * model.time_step)
        states = np.linalg.solve(turn * np.eye(system.order) - system.A, system.B @ strips)
        phasor = (system.C @ states + system.D @ strips)[at : at + 3]
        components += (turn ** np.arange(1, count + 1)[:, None] * phasor).imag
    expected = to_blades(components, azimuths(begun, count))
    last = slice(-round(60.0 / model.time_step), None)
    assert_near(told[name][last], expected[last], 1e-6, name)


def test_a_homogeneous_box_does_what_the_same_recording_does_as_a_gust(tmp_path):
    series = np.sin(0.9 * STEP * np.arange(201)) + 0.3 * np.sin(6.0 * STEP * np.arange(201))
    box = netcdf(tmp_path / "box.nc", MEAN + np.broadcast_to(series[:, None, None], (201, 14, 14)))
    rows = "\n".join(f"{STEP * i:.2f},{value:.17g}" for i, value in enumerate(series))
    (tmp_path / "gust.csv").write_text(f"time [s],wind_perturbation [m/s]\n{rows}\n")
    gust = {"kind": "recorded", "file": str(tmp_path / "gust.csv")}
    told = {"duration": 49.0, "record_samples": True, "full_info": True}
    got, _ = samples(made(box, start=0.0, **told), options={"azimuth": 2.0})
    still = {"turbulence_intensity": 0.0, "gust": gust}
    expected, _ = samples(made(wind=still, **told), options={"azimuth": 2.0})
    for name in ("wind", "rbm", "rbm_edge", "tip_deflection", "tower_fore_aft", "tower_side_side"):
        assert_near(got[name], expected[name], 1e-6, name)


def test_the_three_kinds_of_file_hold_the_same_wind_to_their_numbers_precision(tmp_path):
    wind = rough(30.0)
    spacing = PLACES[1] - PLACES[0]
    files = {
        "bts": {"file": bts(tmp_path / "wind.bts", wind)},
        "hawc2": {
            "file": hawc2(tmp_path / "u.bin", wind - MEAN),
            "shape": wind.shape,
            "spacing": (STEP * MEAN, spacing, spacing),
        },
    }
    expected, _ = samples(made(netcdf(tmp_path / "wind.nc", wind), record_samples=True), seed=5)
    # Half a step of TurbSim's whole numbers [m/s], and a number of 32 bits, beside the wind of about 1 m/s.
    for name, relative in {"bts": 1e-3, "hawc2": 1e-6}.items():
        got, _ = samples(made(**files[name], record_samples=True), seed=5)
        for signal in ("wind", "rbm"):
            assert_near(got[signal], expected[signal], relative, f"{signal} of {name}")


# What a seed means ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    return netcdf(tmp_path_factory.mktemp("box") / "rough.nc", rough(60.0))


def winds(env, seed, options=None):
    return np.ravel(samples(env, seed, options)[0]["wind"])


def test_a_seed_is_a_wind_and_another_seed_another(box):
    env, twin = made(box, record_samples=True), made(box, record_samples=True)
    expected = winds(env, 5)
    np.testing.assert_array_equal(winds(twin, 5), expected)
    assert not np.allclose(winds(env, 6), expected)


@pytest.mark.parametrize(
    "change",
    [{"sensors": {"noise": 1e5}}, {"duration": 2.1}, {"steps_per_action": 10}, {"gravity": True}],
    ids=["noise", "longer", "slower", "gravity"],
)
def test_the_wind_of_a_seed_is_the_same_whatever_else_is_drawn_and_however_long_it_lasts(box, change):
    expected = winds(made(box, record_samples=True), 5)
    got = winds(made(box, record_samples=True, **change), 5)
    np.testing.assert_allclose(got[: len(expected)], expected, rtol=0.0, atol=1e-9)


def test_one_turbine_of_several_meets_the_box_as_the_one_alone(box):
    many = made(box, make=gymnasium.make_vec, num_envs=3)
    seen, _ = many.reset(seed=[7, 8, 9])
    for turbine, seed in enumerate([7, 8, 9]):
        np.testing.assert_allclose(seen[turbine], made(box).reset(seed=seed)[0], rtol=1e-5)


def test_a_pool_holds_the_winds_of_its_seeds(box):
    pooled = {"field": {"kind": "box", "file": box}, "pool": 4}
    got = winds(made(wind=pooled, record_samples=True), 1, {"realisation_seed": 3})
    expected = winds(made(box, record_samples=True), 1, {"realisation_seed": 3})
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-9)


def test_episodes_begin_all_over_the_box_and_fit_into_it(tmp_path):
    # The wind tells the moment: it grows by 0.1 m/s a second.
    series = 0.1 * STEP * (np.arange(41) - 20)
    ramp = netcdf(tmp_path / "ramp.nc", MEAN + np.broadcast_to(series[:, None, None], (41, 14, 14)))
    env = made(ramp, duration=6.0)
    begun = np.array([env.reset(seed=s)[1]["wind_perturbation"] for s in range(100)]) / 0.1 + 5.0
    assert begun.min() >= 0.0
    assert begun.max() <= 4.0
    # Uniform from 0 to 4 s: the mean of 100 lies within 4 standard errors, and none leaves a quarter out.
    assert abs(begun.mean() - 2.0) < 4.0 * 4.0 / np.sqrt(12.0 * 100)
    assert np.histogram(begun, 4, (0.0, 4.0))[0].min() > 0


def test_a_start_that_is_given_is_that_of_every_episode(tmp_path):
    series = 0.01 * STEP * (np.arange(401) - 200)
    ramp = netcdf(tmp_path / "ramp.nc", MEAN + np.broadcast_to(series[:, None, None], (401, 14, 14)))
    env = made(ramp, start=30.0, full_info=True)
    for seed in range(3):
        assert env.reset(seed=seed)[1]["wind_perturbation"] == pytest.approx(0.01 * (30.0 - 50.0), abs=1e-9)


def test_an_intensity_scales_what_varies_and_leaves_the_shear_alone(tmp_path):
    shear = 0.02 * PLACES
    series = np.sqrt(2.0) * np.sin(2.0 * pi * np.arange(401) / 40.0)  # whole periods but for the last point
    wind = MEAN + shear + np.broadcast_to(series[:-1, None, None], (400, 14, 14))
    file = netcdf(tmp_path / "wind.nc", wind)
    told = {"start": 0.0, "duration": 49.0, "record_samples": True}
    one, begun = samples(made(file, **told), options={"azimuth": 0.0})
    two, _ = samples(made(file, turbulence_intensity=2.0 / MEAN, **told), options={"azimuth": 0.0})
    # Of rms 1 m/s in the file: twice as much; the shear's moments are what both have in common.
    assert_near(two["wind"], 2.0 * one["wind"], 1e-9, "wind")
    still = netcdf(tmp_path / "still.nc", MEAN + np.broadcast_to(shear, (400, 14, 14)))
    steady, _ = samples(made(still, **told), options={"azimuth": begun})
    assert_near(two["rbm"] - steady["rbm"], 2.0 * (one["rbm"] - steady["rbm"]), 1e-9, "rbm")


def test_a_specification_with_a_box_goes_through_json_and_makes_again(box):
    env = made(box, start=2.0)
    text = env.spec.to_json()
    assert json.loads(text)["kwargs"]["wind"]["field"] == {"kind": "box", "file": box, "start": 2.0}
    again = gymnasium.make(EnvSpec.from_json(text))
    np.testing.assert_array_equal(again.reset(seed=1)[0], env.reset(seed=1)[0])
    family = made(wind=Wind(field={"kind": "box", "file": box, "start": 2.0}))
    assert json.loads(family.spec.to_json())["kwargs"]["wind"] == json.loads(text)["kwargs"]["wind"]


def test_a_state_of_another_box_under_the_same_name_is_refused(tmp_path):
    file = tmp_path / "wind.nc"
    env = made(netcdf(file, rough(10.0)))
    env.reset(seed=0)
    state = env.unwrapped.get_state()
    same = made(str(file))
    same.unwrapped.set_state(state)
    other = made(netcdf(file, rough(10.0)))
    with pytest.raises(ValueError, match="^state: made by an environment with box"):
        other.unwrapped.set_state(state)


# What is refused ------------------------------------------------------------------------------------------------------


def spoilt(tmp_path, what):
    """Keywords of a box that cannot be taken."""
    path, wind = tmp_path / "wind.nc", rough(10.0)
    if what == "missing":
        return {"file": str(tmp_path / "nowhere.bts")}
    if what == "truncated":
        file = bts(tmp_path / "wind.bts", wind)
        (tmp_path / "wind.bts").write_bytes((tmp_path / "wind.bts").read_bytes()[:-100])
        return {"file": file}
    if what == "truncated netcdf":
        file = netcdf(path, wind)
        path.write_bytes(path.read_bytes()[:-100])
        return {"file": file}
    if what == "of another kind":
        return {"file": hawc2(tmp_path / "u.bin", wind - MEAN)}
    if what == "narrow":
        return {"file": netcdf(path, wind, places=0.8 * PLACES)}
    if what == "low":
        return {"file": netcdf(path, wind, above=-30.0)}
    if what == "short":
        return {"file": netcdf(path, wind), "duration": 20.0}
    if what == "late":
        return {"file": netcdf(path, wind), "start": 9.0}
    if what == "coarse":
        return {"file": netcdf(path, wind, time_step=15.0)}
    if what == "uneven":
        file = netcdf(path, wind)
        with netcdf_file(file, "a") as opened:
            opened.variables["time"][3] += 0.1
        return {"file": file}
    if what == "hole":
        wind[7, 3, 3] = np.nan
        return {"file": netcdf(path, wind)}
    if what == "other mean":
        return {"file": netcdf(path, wind + 2.0)}
    if what == "other mean, turbsim":
        return {"file": bts(tmp_path / "wind.bts", wind + 1.0, mean=12.0)}
    if what == "other size":
        return {"file": hawc2(tmp_path / "u.bin", wind), "shape": (41, 14, 15), "spacing": (2.75, 10.0, 10.0)}
    if what == "shape alone":
        return {"file": hawc2(tmp_path / "u.bin", wind), "shape": wind.shape}
    if what == "hub beside shape":
        return {"file": "u.bin", "shape": wind.shape, "spacing": (2.75, 10.0, 10.0), "hub_height": 90.0}
    assert what == "nothing to scale"
    return {"file": netcdf(path, np.full_like(wind, MEAN)), "turbulence_intensity": 0.1}


REFUSED = {
    "missing": "nowhere.bts: no such file; give its path",
    "truncated": r"wind.bts: expected 48\d{3} bytes for 41 planes, got a file that is cut off, 48\d{3} bytes; copy it",
    "truncated netcdf": "wind.nc: a NetCDF file that is cut off or broken",
    "of another kind": "u.bin: expected TurbSim's .bts or NetCDF, .* a HAWC2 file also needs its shape and spacing",
    "narrow": "wind.nc: box.y: expected a grid that covers the rotor, .* got -52 to 52 m; take a wider grid",
    "low": r"wind.nc: box.z: expected a grid that covers the rotor, .* got -95 to 35 m; .* check the hub's height",
    "short": r"wind.nc: box.u: expected a box that lasts as long as the episode, 20.02 s, got 10 s; take a longer",
    "late": r"wind.nc: expected wind.field.start of at most 8\.6 s, as the box lasts 10 s .* got 9 s",
    "coarse": r"wind.nc: box.time_step: expected at most 2\.57\d+ s, half a revolution, .* got 15 s; give more planes",
    "uneven": "wind.nc: variable time: expected two or more times that increase by even steps",
    "hole": "wind.nc: variable u: expected a number at each point, got nan m/s at 1 of 8036; fill those",
    "other mean": r"wind.nc: box.u: expected a mean over the disk within 10% .* 11 m/s, got 13 m/s; take a model",
    "other mean, turbsim": "wind.bts: box.mean_wind: expected the model's 11 m/s within 1%, got 12 m/s; take a model",
    "other size": "u.bin: expected 34440 bytes for 41 by 14 by 15 numbers .* cut off, 32144 bytes; copy it",
    "shape alone": "field.spacing: missing beside field.shape",
    "hub beside shape": "field.hub_height: expected None beside field.shape, .* got 90 m",
    "nothing to scale": "wind.nc: expected a box whose wind varies in time, .* leave that out",
}


@pytest.mark.parametrize("what", REFUSED)
def test_a_box_that_cannot_be_taken_is_refused_in_one_line_before_any_work(tmp_path, monkeypatch, what):
    monkeypatch.setattr(turbines, "make_plant", lambda *_: pytest.fail("a plant was made"))
    with pytest.raises((ValueError, FileNotFoundError), match=REFUSED[what]) as refusal:
        made(**spoilt(tmp_path, what))
    line = str(refusal.value)
    assert line.startswith(("wind.field.", "field."))
    assert "\n" not in line


def test_many_environments_refuse_a_box_as_one_does(tmp_path):
    with pytest.raises(ValueError, match=r"^wind.field.file: .*wind.nc: box.u: .* as long as the episode"):
        made(**spoilt(tmp_path, "short"), make=gymnasium.make_vec, num_envs=2)


def test_a_box_is_refused_where_the_model_has_no_winds_by_strip(box):
    with pytest.raises(ValueError, match=r"^wind\.field: expected a model with winds by strip"):
        made(box, model="nrel5mw-corrected")


# Extreme gusts of the standard ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("stronger, component, sign", [("above", 1, 1.0), ("right", 2, 1.0)])
def test_the_extreme_shear_loads_the_blades_as_marching_through_the_standard_s_formula_does(
    stronger, component, sign
):
    model = site()
    gust = {"kind": "extreme_wind_shear", "stronger": stronger, "start": 2.0}
    still = {"turbulence_intensity": 0.0, "gust": gust}
    told, begun = samples(
        made(wind=still, duration=16.0, record_samples=True, full_info=True), options={"azimuth": 0.7}
    )
    # IEC 61400-1:2005, 6.3.2.6, class A at 11 m/s: sigma_1 = 0.16 (0.75 * 11 + 5.6), D = 126 m, Lambda_1 = 42 m.
    time = model.time_step * np.arange(len(told["rbm"]) + 1)
    part = np.clip((time - 2.0) / 12.0, 0.0, 1.0)
    size = (2.5 + 0.2 * 6.4 * 0.16 * (0.75 * 11.0 + 5.6) * 3.0**0.25) / 126.0
    radii = nameplate(model.case).strip_radii
    strips = np.zeros((len(time), len(radii), 3))
    strips[..., component] = sign * np.outer(size * (1.0 - np.cos(2.0 * pi * part)), radii)
    system = model.turbine.select(inputs=strip_inputs(model.strips))
    outputs = system.simulate(strips.reshape(len(time), -1), np.zeros(system.order))
    for name in BLADES:
        at = system.outputs.index(f"{name}_0")
        expected = to_blades(outputs[1:, at : at + 3], azimuths(begun, len(told[name])))
        assert_near(told[name], expected, 1e-9, name)
    assert np.abs(told["wind"]).max() < 1e-12  # it leaves the mean over the disk alone


@pytest.mark.parametrize(
    "kind, seconds, expected",
    [
        # 4 arctan(sigma_1 / (V (1 + 0.1 D / Lambda_1))) = 35.2 deg at 11 m/s, class A (docs/wind.md).
        ("extreme_direction_change", 6.0, 11.0 * (cos(radians(35.2)) - 1.0)),
        # 15 m/s more, turned by 720 deg over the wind speed.
        ("extreme_coherent_gust", 10.0, 26.0 * cos(radians(720.0 / 11.0)) - 11.0),
    ],
)
@pytest.mark.parametrize("model", [SITE, "nrel5mw-corrected"])
def test_the_standard_s_other_gusts_blow_in_environments(model, kind, seconds, expected):
    still = {"turbulence_intensity": 0.0, "gust": {"kind": kind, "start": 1.0}}
    env = made(wind=still, model=model, duration=seconds + 2.0, record_samples=True)
    wind = np.ravel(samples(env)[0]["wind"])
    assert wind[-1] == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(
    "given, line",
    [
        (
            {"model": "nrel5mw-corrected"},
            "a gust that is the same over the disk here, got extreme_wind_shear",
        ),
        ({"model": "nrel5mw-corrected-heavy-blade"}, "a gust that is the same over the disk here"),
        ({"single_blade": True}, "a gust that is the same over the disk with single_blade=True"),
    ],
    ids=["no strips", "heavy blade", "single blade"],
)
def test_the_extreme_shear_is_refused_where_no_strips_turn(given, line):
    with pytest.raises(ValueError, match=f"^gust.kind: expected {line}") as refusal:
        made(wind={"gust": {"kind": "extreme_wind_shear"}}, **given)
    assert "\n" not in str(refusal.value)


def test_the_extreme_shear_and_a_box_add(box):
    shear = {"kind": "extreme_wind_shear", "start": -2.0}
    field = {"kind": "box", "file": box}
    told = {"record_samples": True, "full_info": True}
    both, alone, gust = (
        samples(made(wind=wind, **told), options={"azimuth": 0.3})[0]["rbm"]
        for wind in (
            {"field": field, "gust": shear},
            {"field": field},
            {"turbulence_intensity": 0.0, "gust": shear},
        )
    )
    assert_near(both, alone + gust, 1e-12, "rbm")
