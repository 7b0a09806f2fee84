"""An environment's specification tells its length and goes through JSON; what others' libraries give is taken."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import TimeAwareObservation

from flapgym.control import PDGains, pd_agent, save_agent
from flapgym.envs import FlapEnv, FlapVectorEnv
from flapgym.envs.registration import ENVIRONMENTS, TURBINE_ID
from flapgym.evaluation import compare, simulate
from flapgym.wrappers.single import Residual
from tests.synthetic import synthetic_model

ID = TURBINE_ID
MODEL = synthetic_model()
EVERY_NUMBER = {
    "wind_speed": np.float64(11.0),
    "wind": {
        "turbulence_intensity": np.float32(0.1),
        "length_scale": np.float64(147.0),
        "pool": np.int8(100),
    },
    "duration": np.float16(2.0),
    "steps_per_action": np.int8(100),
    "actuators": {
        "effectiveness": np.array([1.0, 0.5, 1.0]),
        "stuck": [None, np.float64(0.05), None],
    },
    "task": {"observe": np.array(["rbm", "flap_angle"]), "tower_weight": np.float16(0.5)},
    "sensors": {"noise": np.int16(100), "delay": np.float64(0.014)},
    "full_info": np.bool_(True),
}


@pytest.mark.filterwarnings(
    "ignore:.*out of date:DeprecationWarning"
)  # of versions that stay beside newer ones
@pytest.mark.parametrize("name", [entry.id for entry in ENVIRONMENTS])
def test_the_specification_tells_the_actions_of_an_episode_without_a_wrapper_that_counts_them(name):
    env = gymnasium.make(name)
    assert env is env.unwrapped
    assert env.spec is not None
    assert env.spec.max_episode_steps == 572  # 20 s of 0.035 s, rounded up
    assert gymnasium.make(name, duration=1.0, steps_per_action=10).spec.max_episode_steps == 15
    assert gymnasium.make_vec(name, num_envs=2, duration=1.0).spec.max_episode_steps == 29


def test_an_episode_ends_where_its_specification_says_also_when_it_is_made_again_from_it(model_file):
    first = gymnasium.make(ID, model=model_file, duration=0.7)
    for env in (first, gymnasium.make(first.spec), gymnasium.make(EnvSpec.from_json(first.spec.to_json()))):
        env.reset(seed=0)
        ends = [env.step(np.zeros(3, dtype=np.float32))[3] for _ in range(first.spec.max_episode_steps)]
        assert ends == [False] * 19 + [True]
        assert env.spec.max_episode_steps == 20


def test_a_vector_made_again_from_its_specification_is_the_same(model_file):
    first = gymnasium.make_vec(ID, num_envs=2, model=model_file, duration=0.7)
    again = gymnasium.make_vec(first.spec, num_envs=2)
    assert again.spec.max_episode_steps == first.spec.max_episode_steps == 20
    np.testing.assert_array_equal(first.reset(seed=0)[0], again.reset(seed=0)[0])


def test_wrappers_that_tell_the_time_work(model_file):
    env = TimeAwareObservation(gymnasium.make(ID, model=model_file, duration=0.7), flatten=False)
    observation, _ = env.reset(seed=0)
    assert observation["time"] == 0
    assert env.step(np.zeros(3, dtype=np.float32))[0]["time"] == 1


def test_a_specification_of_numpy_s_own_numbers_and_arrays_goes_through_json(model_file):
    env = gymnasium.make(ID, model=model_file, **EVERY_NUMBER)
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    np.testing.assert_array_equal(env.reset(seed=3)[0], again.reset(seed=3)[0])
    np.testing.assert_array_equal(env.step(np.ones(3))[0], again.step(np.ones(3))[0])


def test_a_specification_with_paths_modes_and_wrappers_goes_through_json(tmp_path, model_file):
    agent = pd_agent("mine", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))
    save_agent(tmp_path / "mine.json", agent, MODEL, "A test.", {})
    (tmp_path / "wind.csv").write_text("time [s], wind [m/s]\n0, 11\n60, 12\n")
    env = Residual(
        gymnasium.make(
            ID,
            model=tmp_path.__class__(model_file),
            wind={"gust": {"kind": "recorded", "file": tmp_path / "wind.csv"}},
            task={"observe": agent.observe},
            steps_per_action=1,
        ),
        tmp_path / "mine.json",
        np.float32(0.5),
        np.int8(2),
    )
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    np.testing.assert_array_equal(env.reset(seed=3)[0], again.reset(seed=3)[0])
    mode = gymnasium.vector.AutoresetMode.SAME_STEP
    vector = gymnasium.make_vec(ID, num_envs=2, model=model_file, autoreset_mode=mode)
    assert gymnasium.make_vec(EnvSpec.from_json(vector.spec.to_json())).unwrapped.autoreset_mode is mode


@pytest.mark.parametrize("seed", [np.int64(3), np.uint8(3), np.array(3)], ids=lambda seed: str(seed.dtype))
def test_numpy_s_whole_numbers_are_seeds_everywhere(model_file, seed):
    expected = FlapEnv(model=model_file).reset(seed=3)[0]
    np.testing.assert_array_equal(FlapEnv(model=model_file).reset(seed=seed)[0], expected)
    np.testing.assert_array_equal(FlapVectorEnv(2, model=model_file).reset(seed=seed)[0][0], expected)
    np.testing.assert_array_equal(FlapVectorEnv(1, model=model_file).reset(seed=[seed])[0][0], expected)
    agent = pd_agent("pd", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))
    np.testing.assert_array_equal(
        simulate(agent, MODEL, [seed], 1.0).rbm, simulate(agent, MODEL, [3], 1.0).rbm
    )
    if seed.ndim == 0 and isinstance(seed, np.integer):
        assert compare([agent], MODEL, realisations=1, seed=seed, duration=1.0).seed == 3


@pytest.mark.parametrize("seed", [1.5, -1, "3", [], True, np.float64(3.0), np.array([3])], ids=str)
def test_what_is_no_seed_is_refused_by_name_and_leaves_the_episode(model_file, seed):
    env = FlapEnv(model=model_file)
    env.reset(seed=0)
    before = env.get_state()
    with pytest.raises(ValueError, match="^seed: expected a whole number of at least 0, got "):
        env.reset(seed=seed)
    assert env.get_state() == before


def test_a_vector_of_numpy_s_eight_bit_counts_is_that_of_python_s(model_file):
    for count in (np.int8(3), np.int8(100)):
        ours, theirs = FlapVectorEnv(count, model=model_file), FlapVectorEnv(int(count), model=model_file)
        np.testing.assert_array_equal(ours.reset(seed=1)[0], theirs.reset(seed=1)[0])


@pytest.mark.parametrize(
    "count", [0, -1, 1.5, "3", True, 10**9, 10**400, np.array([1, 2])], ids=lambda count: str(count)[:9]
)
def test_absurd_counts_are_refused_in_one_short_line(model_file, count):
    with pytest.raises(ValueError, match="^num_envs: expected a whole number") as refused:
        FlapVectorEnv(count, model=model_file)
    assert len(str(refused.value)) < 200


@pytest.mark.parametrize("option", ["render_mode", "autoreset_mode"])
@pytest.mark.parametrize("value", [[], {}, 3, np.array(["NextStep", "SameStep"]), b"human"], ids=str)
def test_modes_that_are_none_are_refused_by_name(model_file, option, value):
    with pytest.raises(ValueError, match=f"^{option}: expected"):
        FlapVectorEnv(2, model=model_file, **{option: value})


def test_tensors_that_keep_gradients_are_refused_in_one_line_and_others_taken(model_file):
    torch = pytest.importorskip("torch")
    env = FlapEnv(model=model_file)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="^action: expected real numbers"):
        env.step(torch.zeros(3, requires_grad=True))
    assert env.step(torch.zeros(3))[0].shape == (3,)
    with pytest.raises(ValueError, match="^options.azimuth: expected numbers"):
        env.reset(options={"azimuth": torch.tensor(1.0, requires_grad=True)})
    with pytest.raises(ValueError, match="^options.realisation_seed: expected one"):
        env.reset(options={"realisation_seed": [[1], [1, 2]]})
