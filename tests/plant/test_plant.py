"""The fast plant gives what the plain one gives, one turbine or many, one step or many an action, by either kernel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flapgym.plant import Faults, GivenWind, compiled, layout
from flapgym.plant.disturbance import disturbance_modes, disturbance_system
from reference.plant import run
from tests.plant.plants import KERNELS, LENGTH_SCALE, fly, plant_of, rest, series, start_of
from tests.synthetic import synthetic_blade, synthetic_model

QUANTITIES = ("rbm", "tip_deflection", "tower", "flap_angle", "flap_rate")


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("steps, count", [(1, 1), (5, 1), (5, 3), (7, 9)])
def test_every_sample_agrees_with_the_plain_simulation_to_1e9(kernel, steps, count):
    model, actions = synthetic_model(), 600 // steps
    plant = plant_of(count, steps, actions, kernel=kernel)
    start = start_of(plant)
    plant.reset(np.arange(count), start)
    action = np.random.default_rng(1).uniform(-1, 1, (actions, count, 3))
    rows, samples, _ = fly(plant, action)
    assert rows[:, :, layout.STOPPED : layout.STOPPED + 3].any(), "the stops must take part"

    modes, root = disturbance_modes(model, LENGTH_SCALE)
    system = disturbance_system(model, LENGTH_SCALE)
    filter_states = system.order - model.turbine.order
    for turbine in range(min(count, 3)):
        noise = start.intensity[turbine] / model.turbulence_intensity * start.noise[turbine]
        state = (modes.expand @ (noise[: system.order] @ root.T).view(complex)).real
        wind = system.select(outputs=["wind"]).simulate(noise[system.order :, None], state)[:, 0]
        expected = run(
            model,
            np.repeat(model.acceleration_limit * action[:, turbine], steps, axis=0),
            wind,
            start.azimuth[turbine],
            state[filter_states:],
            start.flap_angle[turbine],
            start.flap_rate[turbine],
        )
        for name in QUANTITIES:
            reference = getattr(expected, name)[1:]
            got = series(samples, name)[:, turbine]
            assert np.abs(got - reference).max() < 1e-9 * np.abs(reference).max(), name
        np.testing.assert_allclose(series(samples, "wind")[:, turbine, 0], wind[1:], atol=1e-12)


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_first_row_is_sample_zero_of_the_plain_simulation(kernel):
    model = synthetic_model()
    plant = plant_of(1, 5, 4, kernel=kernel)
    start = replace(start_of(plant), intensity=np.zeros(1))
    _, rows = plant.reset(np.arange(1), start)
    expected = run(
        model,
        np.zeros((1, 3)),
        np.zeros(2),
        start.azimuth[0],
        None,
        start.flap_angle[0],
        start.flap_rate[0],
    )
    np.testing.assert_allclose(rows[0, layout.RBM : layout.RBM + 3], expected.rbm[0], rtol=1e-9)
    np.testing.assert_array_equal(rows[0, layout.ANGLE : layout.ANGLE + 3], start.flap_angle[0])


@pytest.mark.parametrize("kernel", KERNELS)
def test_without_a_tower_three_blades_are_three_single_blades(kernel):
    model = synthetic_model(tower_coupling=0.0)
    plant = plant_of(1, 4, 200, model, kernel=kernel)
    plant.reset(np.arange(1), rest(1, azimuth=np.array([0.7])))
    _, samples, _ = fly(plant, np.random.default_rng(4).uniform(-0.3, 0.3, (200, 1, 3)))
    for blade in range(3):
        angle, rate = (series(samples, name)[:, 0, blade] for name in ("flap_angle", "flap_rate"))
        u = np.stack([angle, rate, np.zeros(800)], axis=1)
        alone = synthetic_blade().simulate(np.vstack([np.zeros(3), u]))[1:, 0]
        np.testing.assert_allclose(
            series(samples, "rbm")[:, 0, blade], alone, atol=1e-9 * np.abs(alone).max()
        )


def test_the_single_blade_is_the_models_blade():
    model = synthetic_model()
    plant = plant_of(2, 4, 100, model, single_blade=True)
    wind = np.sin(0.01 * np.arange(401))
    plant.reset(np.arange(2), rest(2, gust=GivenWind(wind, 0.0)))
    rows, samples, _ = fly(plant, np.random.default_rng(4).uniform(-0.3, 0.3, (100, 2, 1)))
    for turbine in range(2):
        angle, rate = (series(samples, name)[:, turbine, 0] for name in ("flap_angle", "flap_rate"))
        u = np.stack([np.append(0.0, angle), np.append(0.0, rate), wind], axis=1)
        alone = model.blade.simulate(u)[1:]
        for output, name in enumerate(("rbm", "tip_deflection")):
            got = series(samples, name)[:, turbine, 0]
            np.testing.assert_allclose(got, alone[:, output], atol=1e-9 * np.abs(alone[:, output]).max())
    mean_square = np.mean(series(samples, "rbm")[-4:, :, 0] ** 2, axis=0)
    np.testing.assert_allclose(rows[-1, :, layout.REWARD_RBM], -mean_square / model.rbm_rms**2)


@pytest.mark.parametrize("kernel", KERNELS)
def test_an_action_held_for_five_steps_is_five_actions_of_one_step(kernel):
    five, one = (plant_of(2, k, 200 // k, kernel=kernel, every_sample=False) for k in (5, 1))
    start = start_of(one)
    for plant in (five, one):
        plant.reset(np.arange(2), replace(start, noise=start.noise[:, : plant.noise_count]))
    actions = np.random.default_rng(2).uniform(-1.0, 1.0, (40, 2, 3))
    held, _, _ = fly(five, actions)
    single, _, _ = fly(one, np.repeat(actions, 5, axis=0))
    for column in (layout.RBM, layout.TIP, layout.ANGLE, layout.RATE, layout.TRAVEL):
        got, expected = (rows[:, :, column : column + 3] for rows in (held, single[4::5]))
        np.testing.assert_allclose(got, expected, atol=1e-9 * np.abs(expected).max())
    mean_square = slice(layout.MEAN_SQUARE, layout.MEAN_SQUARE + 3)
    np.testing.assert_allclose(
        held[:, :, mean_square], single[:, :, mean_square].reshape(40, 5, 2, 3).mean(axis=1), rtol=1e-9
    )


def test_wind_and_flap_responses_add():
    plant = plant_of(3, 5, 60)
    noise = np.repeat(np.random.default_rng(6).standard_normal((1, plant.noise_count)), 3, axis=0)
    # Turbine 0: wind and flaps; 1: wind alone; 2: flaps alone.
    plant.reset(
        np.arange(3), rest(3, noise=noise, intensity=np.array([0.1, 0.1, 0.0]), azimuth=np.full(3, 0.4))
    )
    action = np.random.default_rng(5).uniform(-0.2, 0.2, (60, 3, 3))
    action[:, 1], action[:, 2] = 0.0, action[:, 0]
    _, samples, _ = fly(plant, action)
    rbm = series(samples, "rbm")
    np.testing.assert_allclose(rbm[:, 0], rbm[:, 1] + rbm[:, 2], atol=1e-6)


def test_a_realisation_is_the_same_however_long_the_actions_are_held():
    winds = []
    for steps in (1, 5):
        plant = plant_of(1, steps, 300 // steps)
        noise = np.random.default_rng(11).standard_normal((1, plant.noise_count))
        plant.reset(np.arange(1), rest(1, noise=noise, intensity=np.array([0.1])))
        winds.append(series(fly(plant, np.zeros((300 // steps, 1, 3)))[1], "wind"))
    np.testing.assert_allclose(winds[0], winds[1], atol=1e-12)


def test_the_first_sample_has_the_variance_of_the_lyapunov_equation():
    model, count = synthetic_model(), 4000
    plant = plant_of(count, 5, 2, model)
    noise = np.random.default_rng(7).standard_normal((count, plant.noise_count))
    _, rows = plant.reset(np.arange(count), rest(count, noise=noise, intensity=np.full(count, 0.1)))
    system = disturbance_system(model, LENGTH_SCALE)
    variance = np.diag(system.C @ system.stationary_covariance() @ system.C.T)
    # Four standard errors of a variance from 4000 draws.
    sampling = 4.0 * np.sqrt(2.0 / count)
    assert rows[:, layout.RBM].var() == pytest.approx(variance[0], rel=sampling)
    assert rows[:, layout.TIP + 1].var() == pytest.approx(variance[3], rel=sampling)
    assert rows[:, layout.TOWER].var() == pytest.approx(variance[6], rel=sampling)
    assert rows[:, layout.WIND].var() == pytest.approx((0.10 * 11.0) ** 2, rel=sampling)


@pytest.mark.parametrize("count", [3, 9])
def test_resetting_one_turbine_leaves_the_others_alone(count):
    plain, disturbed = plant_of(count, 5, 20), plant_of(count, 5, 20)
    start = start_of(plain)
    for plant in (plain, disturbed):
        plant.reset(np.arange(count), start)
    actions = np.random.default_rng(8).uniform(-0.5, 0.5, (10, count, 3))
    for plant in (plain, disturbed):
        fly(plant, actions[:5])
    again = {
        name: getattr(start, name)[[1]]
        for name in ("azimuth", "flap_angle", "flap_rate", "intensity", "noise")
    }
    disturbed.reset(np.array([1]), replace(start, **again))
    expected, got = fly(plain, actions[5:])[0], fly(disturbed, actions[5:])[0]
    others = np.arange(count) != 1
    np.testing.assert_array_equal(got[:, others], expected[:, others])
    assert disturbed.elapsed.tolist() == [10, 5] + [10] * (count - 2)


@pytest.mark.parametrize("every_sample", [True, False])
@pytest.mark.parametrize("steps, count", [(1, 1), (5, 7), (5, 8), (3, 130)])
def test_both_kernels_give_the_same_numbers_with_every_fault(steps, count, every_sample):
    faults = Faults(effectiveness=(0.7, 1.0, 1.2), stuck=(None, 0.04, None), lag=0.05)
    results = []
    for kernel in KERNELS:
        plant = plant_of(count, steps, 40, kernel=kernel, every_sample=every_sample, faults=faults)
        noise = np.random.default_rng(5).standard_normal((count, 41, 3)) * 1e5
        first = plant.reset(np.arange(count), start_of(plant, measurement_noise=noise))
        rows, samples, observation = fly(
            plant, np.random.default_rng(3).uniform(-1.5, 1.5, (40, count, 3)).astype(np.float32)
        )
        results.append((*first, rows, samples, observation))
    for got, expected in zip(*results, strict=True):
        scale = np.abs(expected).max(axis=tuple(range(expected.ndim - 1)), initial=1e-12)
        rounding = 1e-7 if expected.dtype == np.float32 else 1e-11
        assert (np.abs(got - expected) <= rounding * scale).all()


def test_single_precision_stays_within_a_ten_thousandth_of_double():
    rows = []
    for precision in ("float64", "float32"):
        plant = plant_of(9, 5, 400, precision=precision)
        plant.reset(np.arange(9), start_of(plant))
        rows.append(fly(plant, np.random.default_rng(3).uniform(-1.0, 1.0, (400, 9, 3)))[0])
    for column in (layout.RBM, layout.TIP):
        expected, got = (values[:, :, column : column + 3] for values in rows)
        assert np.abs(got - expected).max() < 1e-4 * np.sqrt(np.mean(expected**2))
    np.testing.assert_array_equal(rows[0][:, :, layout.ANGLE], rows[1][:, :, layout.ANGLE])


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_floating_flap_carries_no_load_and_a_stuck_one_does_not_move(kernel):
    faults = Faults(effectiveness=(0.0, 1.0, 1.0), stuck=(None, 0.02, -0.03))
    plant = plant_of(1, 5, 50, kernel=kernel, faults=faults)
    plant.reset(np.arange(1), rest(1))
    still = fly(plant, np.zeros((50, 1, 3)))[1]
    plant.reset(np.arange(1), rest(1))
    moved = fly(plant, np.ones((50, 1, 3)))[1]
    assert series(moved, "flap_angle")[-1, 0, 0] == plant.model.flap_angle_limit
    np.testing.assert_array_equal(series(moved, "flap_angle")[:, 0, 1:], np.tile([0.02, -0.03], (250, 1)))
    assert not series(moved, "flap_rate")[:, 0, 1:].any()
    np.testing.assert_allclose(series(moved, "rbm"), series(still, "rbm"), rtol=1e-12)


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_state_given_back_goes_on_bit_for_bit(kernel):
    plant, twin = plant_of(9, 5, 30, kernel=kernel), plant_of(9, 5, 30, kernel=kernel)
    actions = np.random.default_rng(0).uniform(-1, 1, (20, 9, 3))
    start = start_of(plant)
    plant.reset(np.arange(9), start)
    fly(plant, actions[:10])
    twin.reset(np.arange(9), start)
    for turbine in range(9):
        twin.set_state(turbine, plant.get_state(turbine))
    np.testing.assert_array_equal(fly(twin, actions[10:])[0], fly(plant, actions[10:])[0])


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("count", [2, 9])
def test_bad_actions_are_told_by_place_and_change_nothing(kernel, count):
    plant = plant_of(count, 5, 30, kernel=kernel)
    plant.reset(np.arange(count), start_of(plant))
    before = [plant.get_state(turbine) for turbine in range(count)]
    actions = np.zeros(3 * count)
    actions[4] = np.inf
    observation, rows = np.empty(3 * count, np.float32), np.empty(count * layout.ROW)
    assert plant.step(actions, observation, rows) == -6
    actions[2] = np.nan
    assert plant.step(actions.astype(np.float32), observation, rows) == -4
    assert plant.step(np.zeros(3), observation, rows) == -1
    with pytest.raises(TypeError):
        plant.step(np.zeros((count, 3)), observation, rows)
    assert [plant.get_state(turbine) for turbine in range(count)] == before


@pytest.mark.parametrize("count", [2, 17])
def test_compiled_code_writes_nowhere_but_where_it_has_room(count):
    plant = plant_of(count, 5, 30, kernel="numba", every_sample=True)
    plant.reset(np.arange(count), start_of(plant))
    actions, before = np.zeros(3 * count), plant.get_state(0)
    room = {
        "observation": np.full(6 * count, 7.0, np.float32),
        "rows": np.full(2 * count * layout.ROW, 7.0),
        "samples": np.full(10 * count * layout.SAMPLE, 7.0),
    }
    fits = {name: array[: array.size // 2] for name, array in room.items()}
    for name, array in room.items():
        for wrong in (array[: array.size // 2 - 1], array):
            assert plant.step(actions, **(fits | {name: wrong})) == -1
        for wrong in (array[::2], array[::-1][: array.size // 2], fits[name].astype(np.float16)):
            with pytest.raises(TypeError):
                plant.step(actions, **(fits | {name: wrong}))
    assert all((array == 7.0).all() for array in room.values())
    assert plant.get_state(0) == before
    assert plant.step(actions, **fits) == 0
    assert all((array[array.size // 2 :] == 7.0).all() for array in room.values())


def test_plants_of_a_process_share_a_pool_whose_members_are_the_realisations_of_seeds():
    one, other = (plant_of(2, 5, 20, pool=4) for _ in range(2))
    assert one._responses.rows is other._responses.rows
    alone = plant_of(2, 5, 20)
    noise = np.stack([np.random.default_rng(seed).standard_normal(alone.noise_count) for seed in (3, 1)])
    intensity, actions = np.array([0.1, 0.05]), np.zeros((20, 2, 3))
    one.reset(np.arange(2), rest(2, realisation=np.array([3, 1]), intensity=intensity))
    alone.reset(np.arange(2), rest(2, noise=noise, intensity=intensity))
    np.testing.assert_allclose(fly(one, actions)[0], fly(alone, actions)[0], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("count", [2, 20])
@pytest.mark.parametrize("kernel", KERNELS)
def test_a_plant_asked_for_no_displacements_gives_the_same_moments(kernel, count):
    rows = {}
    for displacements in (True, False):
        plant = plant_of(count, 3, 6, every_sample=False, displacements=displacements, kernel=kernel)
        plant.reset(np.arange(count), start_of(plant))
        actions = np.random.default_rng(1).uniform(-1, 1, (6, count, 3))
        rows[displacements] = fly(plant, actions)[0][..., : layout.REWARD]
    told = np.r_[layout.RBM : layout.TIP, layout.ANGLE : layout.TOWER, layout.WIND : layout.REWARD]
    np.testing.assert_allclose(rows[False][..., told], rows[True][..., told], rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_quick_step_tells_what_the_row_says(kernel):
    plant = plant_of(1, 3, 6, every_sample=False, kernel=kernel)
    plant.reset(np.arange(1), start_of(plant))
    row = np.empty(layout.ROW)
    function, first = plant.quick
    told = function(first, np.ones(3, np.float32), np.empty(3, np.float32), row)
    assert told == (0, row[layout.REWARD], row[layout.WIND])


def test_code_compiled_from_other_files_refuses_to_serve():
    plant = plant_of(1, 3, 6, every_sample=False, kernel="numba")
    plant.reset(np.arange(1), start_of(plant))
    plant._state[layout.LAYOUT] += 1
    row = np.full(layout.ROW, 7.0)
    assert plant.step(np.ones(3, np.float32), np.empty(3, np.float32), row) == compiled.OUTDATED
    assert (row == 7.0).all()


@pytest.mark.parametrize("count", [2, 9])
def test_commands_at_their_bounds_leave_the_kernels_together(count):
    rows = []
    for kernel in KERNELS:
        plant = plant_of(count, 5, 600, kernel=kernel, every_sample=False)
        plant.reset(np.arange(count), start_of(plant))
        action = np.random.default_rng(2).choice([-1.0, 1.0], (600, count, 3))
        rows.append(fly(plant, action)[0])
    assert rows[0][:, :, layout.STOPPED : layout.STOPPED + 3].any()
    # Whether a flap that comes to rest at the very stop has met it is anyone's word.
    for column in (layout.RBM, layout.ANGLE, layout.RATE):
        got, expected = (each[:, :, column : column + 3] for each in rows)
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("count", [2, 17])
def test_past_the_end_of_an_episode_no_noise_of_others_is_seen(count):
    seen = []
    for kernel in KERNELS:
        plant = plant_of(count, 5, 4, kernel=kernel, every_sample=False)
        noise = np.random.default_rng(5).standard_normal((count, 5, 3)) * 1e5
        plant.reset(np.arange(count), start_of(plant, measurement_noise=noise))
        seen.append(fly(plant, np.zeros((7, count, 3)))[2])
    np.testing.assert_allclose(seen[0], seen[1], rtol=1e-6)


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("count", [1, 20])
def test_flaps_at_rest_leave_no_denormal_numbers_in_the_modes(count, precision):
    plant = plant_of(count, 5, 100_000, kernel="numba", every_sample=False, precision=precision, pool=1)
    plant.reset(np.arange(count), rest(count, realisation=np.zeros(count, dtype=np.int64)))
    observation, rows = np.empty(6 * count, np.float32), np.empty(count * layout.ROW)
    plant.step(np.ones(3 * count), observation, rows)
    for _ in range(30_000):
        plant.step(np.zeros(3 * count), observation, rows)
    modes = np.abs(plant._modes(0))
    assert not ((modes > 0.0) & (modes < np.finfo(precision).tiny)).any()


def test_only_flat_writeable_arrays_of_the_right_type_are_filled():
    plant = plant_of(1, 5, 30, kernel="numba", every_sample=False)
    plant.reset(np.arange(1), start_of(plant))
    size = plant.task.size
    good, row = np.empty(size, np.float32), np.empty(layout.ROW)
    frozen = np.empty(size, np.float32)
    frozen.flags.writeable = False
    for wrong in (np.empty((1, size), np.float32), np.empty(size, np.int32), np.empty(size, ">f4"), frozen):
        with pytest.raises(TypeError, match="observation"):
            plant.step(np.zeros(3), wrong, row)
    with pytest.raises(TypeError, match="rows"):
        plant.step(np.zeros(3), good, np.empty((1, layout.ROW)))
