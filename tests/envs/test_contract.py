"""Gymnasium's and Stable-Baselines3's own checks, and the conventions users rely on. Warnings are errors throughout."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import flapgym
from flapgym.envs.task import LIDAR, OBSERVABLES, PITCH, SPEED
from tests.synthetic import synthetic_model

ID = "flapgym/NREL5MW-v1"
EVERYTHING = tuple(name for name in OBSERVABLES if name not in PITCH | LIDAR | SPEED)
SIZES = {"azimuth": 2, "tower_top": 2, "wind": 1}
"""Entries of what is not one a blade."""


def _make(model_file, **keywords):
    return gymnasium.make(ID, model=model_file, **keywords)


@pytest.mark.parametrize("observe", [("rbm",), EVERYTHING])
@pytest.mark.parametrize("steps_per_action", [1, 5])
def test_gymnasium_checker_passes(model_file, observe, steps_per_action):
    env = _make(model_file, task={"observe": observe}, steps_per_action=steps_per_action, record_samples=True)
    check_env(env.unwrapped)
    env.close()


def test_stable_baselines_checker_passes(model_file):
    from stable_baselines3.common.env_checker import check_env as check_for_sb3

    check_for_sb3(_make(model_file, task={"observe": EVERYTHING}, sensors={"noise": 1e4}).unwrapped)


def test_the_shipped_model_is_the_default():
    env = gymnasium.make(ID, full_info=True)
    observation, info = env.reset(seed=0)
    assert observation.shape == (3,)
    assert observation.dtype == np.float32
    np.testing.assert_allclose(observation, 1e-6 * info["rbm"], rtol=1e-6)
    assert env.unwrapped.model.wind_speed == 11.0


@pytest.mark.parametrize("dtype", [np.float32, np.float64, ">f4", np.float16, np.int64])
def test_actions_that_came_from_another_process_act_like_any_other(model_file, dtype):
    env, twin = _make(model_file), _make(model_file)
    action = np.array([1, 0, -1], dtype=dtype)
    for one in (env, twin):
        one.reset(seed=0)
    # Unpickled, its type equals NumPy's own and is another object.
    step = env.step(pickle.loads(pickle.dumps(action)))
    np.testing.assert_array_equal(step[0], twin.step(np.array([1, 0, -1], dtype=np.float32))[0])


def test_a_module_prefix_registers_the_environment():
    code = 'import gymnasium; print(gymnasium.make("flapgym:flapgym/NREL5MW-v1").spec.id)'
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == ID


def test_the_spec_survives_pickle_and_json(model_file):
    env = _make(model_file, task={"observe": ("rbm", "flap_angle")}, duration=1.0)
    first = env.reset(seed=3)[0]
    for spec in (pickle.loads(pickle.dumps(env.spec)), EnvSpec.from_json(env.spec.to_json())):
        np.testing.assert_array_equal(gymnasium.make(spec).reset(seed=3)[0], first)


@pytest.mark.parametrize(
    "copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"]
)
def test_a_copy_made_in_mid_episode_goes_on_as_the_original(model_file, copied):
    env = flapgym.envs.FlapEnv(model=model_file, sensors={"noise": 1e4})
    env.reset(seed=3)
    actions = np.random.default_rng(0).uniform(-1, 1, (40, 3))
    for action in actions[:20]:
        env.step(action)
    twin = copied(env)
    for action in actions[20:]:
        expected, got = env.step(action), twin.step(action)
        np.testing.assert_array_equal(got[0], expected[0])
        assert got[1] == expected[1]
    np.testing.assert_array_equal(env.reset()[0], twin.reset()[0])


def test_an_episode_lasts_its_duration_and_is_truncated(model_file):
    env = _make(model_file, duration=1.0, steps_per_action=10)
    env.reset(seed=0)
    ends = []
    while not any(ends[-1:]):
        _, _, terminated, truncated, _ = env.step(np.zeros(3, dtype=np.float32))
        assert not terminated
        ends.append(truncated)
    assert len(ends) == 15  # 0.07 s each
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.unwrapped.step(np.zeros(3))


def test_only_a_state_that_is_not_finite_terminates(model_file):
    env = flapgym.envs.FlapEnv(model=model_file)
    env.reset(seed=0)
    env._turbines.plant.episode.responses[:] = (
        np.nan
    )  # no action and no state an environment takes can do that
    env._load()
    _, _, terminated, truncated, _ = env.step(np.zeros(3))
    assert terminated
    assert not truncated


def test_the_reward_is_minus_the_mean_square_of_every_sample_plus_the_named_terms(model_file):
    env = _make(
        model_file,
        full_info=True,
        record_samples=True,
        task={"flap_angle_weight": 0.3, "tower_weight": 2.0},
        steps_per_action=7,
        duration=2.0,
    ).unwrapped
    env.reset(seed=5)
    rng = np.random.default_rng(0)
    for _ in range(20):
        _, reward, _, _, info = env.step(rng.uniform(-1, 1, 3))
        samples = info["samples"]
        assert samples["rbm"].shape == (7, 3)
        rbm = -np.mean(samples["rbm"] ** 2) / env.model.rbm_rms**2
        flap = -0.3 * np.mean((samples["flap_angle"] / env.model.flaps[0].angle_limit) ** 2)
        tower = -2.0 * np.mean(samples["tower_fore_aft"] ** 2)
        assert info["reward_rbm"] == pytest.approx(rbm)
        assert info["reward_flap_angle"] == pytest.approx(flap)
        assert info["reward_tower"] == pytest.approx(tower)
        assert reward == pytest.approx(rbm + flap + tower)
        for name in ("rbm", "tip_deflection", "flap_angle", "flap_rate"):
            np.testing.assert_array_equal(samples[name][-1], info[name])


def test_observations_come_in_the_documented_order_units_and_bounds(model_file):
    env = _make(model_file, task={"observe": EVERYTHING}, full_info=True).unwrapped
    env.reset(seed=1)
    observation, _, _, _, info = env.step(np.array([0.5, -1.0, 0.2]))
    expected = [
        info["rbm"] * 1e-6,
        info["flap_angle"],
        info["flap_rate"],
        info["tip_deflection"],
        [np.cos(info["azimuth"]), np.sin(info["azimuth"])],
        info["tower_top"],
        [info["wind_perturbation"]],
    ]
    np.testing.assert_allclose(observation, np.concatenate(expected), rtol=1e-6, atol=1e-7)
    assert env.observation_space.high[:6] == pytest.approx([50] * 3 + [np.deg2rad(10)] * 3)
    for name in EVERYTHING:
        quantity = OBSERVABLES[name]
        assert f"| `{name}` | {SIZES.get(name, '3')} | {quantity.unit} |" in (
            flapgym.envs.FlapEnv.__doc__ or ""
        )
        assert len(env.observed[name]) == SIZES.get(name, 3)


def test_measurement_noise_touches_the_observation_only(model_file):
    clean, noisy = (
        _make(model_file, sensors={"noise": level}, full_info=True).unwrapped for level in (0.0, 2e4)
    )
    seen = []
    (start, _), (noisy_start, _) = (
        env.reset(seed=2, options={"realisation_seed": 4, "azimuth": 0.0}) for env in (clean, noisy)
    )
    seen.append(noisy_start - start)
    for _ in range(500):
        plain, disturbed = clean.step(np.zeros(3)), noisy.step(np.zeros(3))
        assert plain[1] == disturbed[1]
        np.testing.assert_array_equal(plain[4]["rbm"], disturbed[4]["rbm"])
        seen.append(disturbed[0] - plain[0])
    assert np.std(seen) == pytest.approx(2e-2, rel=0.1)


def test_still_air_leaves_the_turbine_at_rest(model_file):
    env = _make(model_file, wind={"turbulence_intensity": 0.0}).unwrapped
    observation, info = env.reset(seed=0)
    for _ in range(10):
        observation, reward, _, _, info = env.step(np.zeros(3))
    assert not observation.any()
    assert reward == 0.0
    assert info["wind_perturbation"] == 0.0


def test_reset_options_set_wind_azimuth_and_flaps(model_file):
    env = _make(model_file, full_info=True).unwrapped
    options = {"realisation_seed": 9, "azimuth": 1.25, "flap_angle": 0.05, "flap_rate": [0.1, 0.0, -0.1]}
    _, first = env.reset(seed=1, options=options)
    _, second = env.reset(seed=2, options=options)
    assert first["wind_perturbation"] == second["wind_perturbation"]
    assert first["azimuth"] == 1.25
    np.testing.assert_array_equal(first["flap_angle"], np.full(3, 0.05))
    np.testing.assert_array_equal(second["flap_rate"], [0.1, 0.0, -0.1])


@pytest.mark.parametrize(
    "options, name",
    [
        ({"azimut": 0.0}, "azimut"),
        ({"azimuth": np.nan}, "azimuth"),
        ({"azimuth": "north"}, "azimuth"),
        ({"azimuth": "1.0"}, "azimuth"),
        ({"flap_angle": 0.3}, "flap_angle"),
        ({"flap_rate": [0.0, 0.0]}, "flap_rate"),
        ({"realisation_seed": -1}, "realisation_seed"),
        ({"realisation_seed": 0.5}, "realisation_seed"),
        ({"turbulence_intensity": 1.0}, "turbulence_intensity: expected a fraction .* below 1"),
        ({"turbulence_intensity": -0.1}, "turbulence_intensity: expected a fraction"),
    ],
)
def test_impossible_reset_options_are_refused_by_name(model_file, options, name):
    with pytest.raises(ValueError, match=name):
        _make(model_file).unwrapped.reset(options=options)


@pytest.mark.parametrize(
    "keyword, value",
    [
        ("wind.turbulence_intensity", 10.0),
        ("wind.turbulence_intensity", -0.1),
        ("wind.length_scale", 0.0),
        ("duration", np.inf),
        ("duration", "20 s"),
        ("sensors.noise", -1.0),
        ("steps_per_action", 0),
        ("steps_per_action", 2.5),
        ("task.observe", ()),
        ("task.observe", ("rbm", "moment")),
        ("task.observe", ("rbm", "rbm")),
        ("task.observe", 5),
        ("task.observe", [["rbm"]]),
        ("task.tower_weight", -1.0),
        ("task.tower_weight", 1e308),
        ("task.flap_angle_weight", 1e308),
        ("sensors.noise", 1e300),
        ("sensors.noise", 10**400),
        ("sensors.noise", np.complex64(1.0)),
        ("wind.length_scale", 1e-9),
        ("wind.length_scale", 1e300),
        ("duration", 1e308),
        ("actuators.lag", 1e300),
        ("sensors.delay", 1e300),
        ("full_info", "yes"),
        ("record_samples", 2),
        ("render_mode", "ansi"),
        ("render_mode", []),
        ("render_mode", np.array(["human", "rgb_array"])),
        ("backend", np.array(["numba", "numpy"])),
        ("precision", []),
        ("task.observe", {"rbm", "flap_angle"}),
        ("task.observe", {"rbm": 1}),
        ("task.observe", b"rbm"),
        ("actuators.stuck", {0.01, 0.02, None}),
        ("actuators.effectiveness", {0.1, 0.2, 0.3}),
        ("wind.turbulence_intensity", {0.1}),
        ("wind.pool", 10**12),
        ("wind.turbulence_intensty", 0.1),
        ("task.reward", 1.0),
        ("wind", 0.1),
        ("sensors", None),
        ("single_blade", 1),
    ],
)
def test_impossible_keywords_are_refused_in_one_line_that_begins_with_them(model_file, keyword, value):
    family, *field = keyword.split(".")
    with pytest.raises(ValueError) as refused:
        flapgym.envs.FlapEnv(**{"model": model_file, family: {field[0]: value} if field else value})
    line = str(refused.value)
    assert line.startswith((f"{keyword}: expected", f"{keyword}: unknown key; "))
    assert "\n" not in line
    assert len(line) < 400


def test_a_model_that_is_neither_name_nor_file_is_refused_by_name():
    with pytest.raises(ValueError, match="model: expected"):
        flapgym.envs.FlapEnv(model=3)


def test_an_unknown_keyword_is_refused_by_name(model_file):
    with pytest.raises(TypeError, match="argument 'steps_per_acton'; did you mean 'steps_per_action'"):
        _make(model_file, steps_per_acton=5)


@pytest.mark.parametrize("vector", [False, True])
def test_an_unknown_keyword_is_refused_in_the_words_that_other_libraries_look_for(model_file, vector):
    make = (
        (lambda **more: gymnasium.make_vec(ID, num_envs=2, **more))
        if vector
        else (lambda **more: gymnasium.make(ID, **more))
    )
    with pytest.raises(TypeError, match="got an unexpected keyword argument 'frameskip'"):
        make(model=model_file, frameskip=4)

    def native(model):
        """The words of Python itself."""

    with pytest.raises(TypeError, match="got an unexpected keyword argument 'frameskip'"):
        native(model=1, frameskip=4)


def test_a_limit_of_steps_is_refused_with_what_to_give(model_file):
    with pytest.raises(
        ValueError, match="max_episode_steps: expected 572, .* got 5; give duration in its place"
    ):
        gymnasium.make_vec(ID, num_envs=2, model=model_file, max_episode_steps=5)
    with pytest.raises(TypeError, match="unexpected keyword argument 'max_episode_steps'; give duration"):
        flapgym.envs.FlapEnv(model=model_file, max_episode_steps=5)


EXTREMES = {
    "wind": ("length_scale", (1.0, 1e5)),
    "sensors": ("noise", (0.0, 5e7)),
    "task of angles": ("flap_angle_weight", (0.0, 1e6)),
    "task of the tower": ("tower_weight", (0.0, 1e6)),
}


@pytest.mark.parametrize("what", EXTREMES)
def test_the_largest_and_least_numbers_give_finite_episodes(model_file, what):
    family, (name, values) = what.split()[0], EXTREMES[what]
    beyond = values[1] * 1.01
    with pytest.raises(ValueError, match=rf"^{family}\.{name}: expected .*, got"):
        flapgym.envs.FlapEnv(**{"model": model_file, family: {name: beyond}})
    for value in values:
        env = flapgym.envs.FlapEnv(**{"model": model_file, "duration": 0.7, family: {name: value}})
        assert np.isfinite(env.reset(seed=0)[0]).all()
        for _ in range(20):
            observation, reward, terminated, _, _ = env.step(np.ones(3))
            assert np.isfinite(observation).all()
            assert np.isfinite(reward)
            assert not terminated


def test_another_wind_speed_is_refused_with_the_line_that_builds_its_model(model_file):
    with pytest.raises(ValueError, match=r"flapgym build .*13mps\.toml --output .*13mps\.safetensors"):
        _make(model_file, wind_speed=13.0)
    assert _make(model_file, wind_speed=11.0).unwrapped.model.wind_speed == 11.0


BAD_ACTIONS = [
    [0.0, np.nan, 0.0],
    [np.inf, 0.0, 0.0],
    [0.0, 0.0],
    [[0.0, 0.0, 0.0]],
    0.0,
    None,
    "full",
    [[0.0], [0.0, 1.0], [0.0]],
    [0.5j, 0.0, 0.0],
    np.zeros(3, dtype=complex),
    np.zeros(3, dtype=np.complex64),
    ["1", "0", "0"],
    b"abc",
    np.array(["2020-01-01"] * 3, dtype="M8[s]"),
    np.array([1, 2, 3], dtype="m8[s]"),
    np.array([None, 0.0, 0.0], dtype=object),
    np.array(["1", 0.0, 0.0], dtype=object),
    np.ma.masked_array([1.0, 0.0, 0.0], [True, False, False]),
    [10**400, 0, 0],
    np.full(3, np.longdouble("1e400")),
    {},
    [{"a": 1}, 0, 0],
]


@pytest.mark.parametrize("action", BAD_ACTIONS, ids=str)
def test_a_bad_action_is_refused_and_leaves_the_state_untouched(model_file, action):
    env, twin = _make(model_file).unwrapped, _make(model_file).unwrapped
    for one in (env, twin):
        one.reset(seed=8)
    for _ in range(3):
        with pytest.raises(ValueError, match="action"):
            env.step(action)
        got, expected = env.step([0.3, -0.2, 1.0]), twin.step([0.3, -0.2, 1.0])
        np.testing.assert_array_equal(got[0], expected[0])
        assert got[1] == expected[1]


GOOD_ACTIONS = [
    [0.3, -0.2, 1.0],
    (1, 0, -1),
    [True, False, True],
    np.array([1, 2, -3], dtype=object),
    np.ma.masked_array([1.0, 0.5, 0.0], [False] * 3),
    np.full(3, np.longdouble(1e30)),
    [1e300, -1e300, 1e308],
    np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], dtype=np.float32)[::2],
]


@pytest.mark.parametrize("action", GOOD_ACTIONS, ids=str)
def test_whatever_holds_real_numbers_is_an_action(model_file, action):
    env, twin = _make(model_file).unwrapped, _make(model_file).unwrapped
    for one in (env, twin):
        one.reset(seed=8)
    expected = twin.step(np.clip(np.array(action, dtype=float), -1.0, 1.0).astype(np.float32))
    np.testing.assert_allclose(env.step(action)[0], expected[0], rtol=1e-6)


def _taken(shape):
    return st.one_of(
        arrays(np.float32, shape, elements=st.floats(-2.0, 2.0, width=32)),
        arrays(np.float64, shape, elements=st.floats(-1e6, 1e6)),
        arrays(np.int8, shape, elements=st.integers(-2, 2)).map(lambda action: action.tolist()),
    )


def _refused(shape):
    def spoilt(given):
        action, place, value = given
        action.flat[place] = value
        return action

    size = int(np.prod(shape))
    fine = arrays(np.float64, shape, elements=st.floats(-2.0, 2.0))
    other = st.sampled_from([shape[:-1], (*shape[:-1], 2), (*shape, 1), (size + 1,), (0,), ()])
    return st.one_of(
        st.tuples(fine, st.integers(0, size - 1), st.sampled_from([np.nan, np.inf, -np.inf])).map(spoilt),
        st.tuples(
            arrays(object, shape, elements=st.floats(-2.0, 2.0)),
            st.integers(0, size - 1),
            st.sampled_from([None, "up", 1j, 10**400]),
        ).map(spoilt),
        other.flatmap(lambda shape: arrays(np.float32, shape, elements=st.just(0.5))),
        st.sampled_from([complex, "U3", "M8[s]", bytes]).map(lambda dtype: np.zeros(shape, dtype=dtype)),
        st.sampled_from([None, "full", {}, [[0.0], [0.0, 1.0]]]),
    )


@settings(max_examples=60, deadline=None)
@given(st.data(), st.sampled_from([None, "NextStep", "SameStep", "Disabled"]))
def test_bad_actions_among_good_ones_change_nothing(data, mode):
    keywords = {"model": synthetic_model(), "sensors": {"noise": 1e4}}
    env, twin = (
        flapgym.envs.FlapEnv(**keywords)
        if mode is None
        else flapgym.envs.FlapVectorEnv(2, autoreset_mode=mode, **keywords)
        for _ in range(2)
    )
    for one in (env, twin):
        one.reset(seed=1)
    shape = env.action_space.shape
    for _ in range(data.draw(st.integers(1, 12))):
        if data.draw(st.booleans()):
            action = data.draw(_taken(shape))
            for got, expected in zip(env.step(action)[:4], twin.step(action)[:4], strict=True):
                np.testing.assert_array_equal(got, expected)
        else:
            with pytest.raises(ValueError, match="^action: expected"):
                env.step(data.draw(_refused(shape)))
        assert env.get_state() == twin.get_state()


@settings(max_examples=60, deadline=None)
@given(
    arrays(np.float64, (40, 3), elements=st.one_of(st.sampled_from([-1.0, 1.0]), st.floats(-1e6, 1e6))),
    st.sampled_from([1, 5, 10]),
)
def test_no_actions_push_a_flap_past_its_stops(actions, steps_per_action):
    env = flapgym.envs.FlapEnv(
        model=synthetic_model(), steps_per_action=steps_per_action, record_samples=True
    )
    env.reset(seed=0)
    for action in actions:
        observation, reward, terminated, _, info = env.step(action)
        assert np.abs(info["samples"]["flap_angle"]).max() <= env.model.flaps[0].angle_limit
        assert np.abs(info["samples"]["flap_rate"]).max() <= env.model.flaps[0].rate_limit
        assert observation in env.observation_space
        assert np.isfinite(reward)
        assert not terminated


def test_importing_the_package_loads_nothing_heavy():
    code = (
        "import sys, flapgym; heavy = ('torch', 'stable_baselines3', 'control', 'matplotlib', 'pygame'); "
        "print([name for name in heavy if name in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


@pytest.mark.parametrize("options", [{"azimut": 1.0}, {"flap_angle": 9.0}, [1], "azimuth"], ids=str)
def test_a_refused_reset_changes_neither_the_episode_nor_the_seed(model_file, options):
    for env in (flapgym.envs.FlapEnv(model=model_file), flapgym.envs.FlapVectorEnv(2, model=model_file)):
        env.reset(seed=0)
        before = env.get_state()
        with pytest.raises(ValueError, match="^options"):
            env.reset(seed=9, options=options)
        assert env.get_state() == before


@pytest.mark.parametrize(
    "copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"]
)
def test_an_environment_of_a_model_that_no_file_holds_can_be_copied(copied):
    env = flapgym.envs.FlapEnv(model=synthetic_model())
    env.reset(seed=0)
    np.testing.assert_array_equal(copied(env).step(np.ones(3))[0], env.step(np.ones(3))[0])


def test_a_wind_speed_that_differs_in_the_last_digits_is_told_from_the_model_s(model_file):
    with pytest.raises(
        ValueError, match=r"built for 11 m/s, got 11\.000001 m/s; .*wind_speed = \"11\.000001 m/s\""
    ):
        _make(model_file, wind_speed=11.000001)


def test_a_recording_that_is_too_short_is_refused_with_the_duration_that_fits(model_file, tmp_path):
    rows = "".join(f"{1704067200 + second}, 11.5\n" for second in range(21))
    (tmp_path / "mast.csv").write_text(f"time [s], wind [m/s]\n{rows}")
    gust = {"kind": "recorded", "file": str(tmp_path / "mast.csv")}
    with pytest.raises(
        ValueError, match=r"duration: .*at most 19\.985 s, whole actions of 0\.035 s.* got 20 s"
    ):
        _make(model_file, wind={"gust": gust}, duration=20.0)
    assert _make(model_file, wind={"gust": gust}, duration=19.985).reset(seed=0)[0].shape == (3,)
    with pytest.raises(
        ValueError, match=r"gust.start: .* holds 1704067200 to 1704067220 s; .* got 1704067100\.5 s"
    ):
        _make(model_file, wind={"gust": gust | {"start": 1704067100.5}}, duration=5.0)
