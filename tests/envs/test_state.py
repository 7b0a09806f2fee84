"""A state given back goes on bit for bit, through JSON and pickle; pools and intensities by environment."""

from __future__ import annotations

import copy
import json
import pickle

import numpy as np
import pytest

from flapgym.envs import FlapEnv, FlapVectorEnv
from tests.synthetic import synthetic_model

THROUGH = {
    "json": lambda state: json.loads(json.dumps(state)),
    "pickle": lambda state: pickle.loads(pickle.dumps(state)),
}
VARIANTS = {
    "plain": {},
    "numpy": {"backend": "numpy"},
    "single precision": {"precision": "float32"},
    "noise and lag": {
        "sensors": {"noise": 1e4},
        "actuators": {"lag": 0.05},
        "task": {"observe": ("rbm", "flap_angle")},
    },
    "pool": {"wind": {"pool": 3}},
    "delay": {"sensors": {"delay": 0.014}},
    "gust": {"wind": {"gust": {"kind": "step", "size": 1.0, "start": 0.2}}},
}


def _keywords(variant):
    return {"model": synthetic_model(), "duration": 0.7, "full_info": True, **VARIANTS[variant]}


def _assert_equal(got, expected):
    for one, other in zip(got[:4], expected[:4], strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(got[4]["rbm"], expected[4]["rbm"])


@pytest.mark.parametrize("through", THROUGH)
@pytest.mark.parametrize("variant", VARIANTS)
def test_one_turbine_goes_on_bit_for_bit_into_the_next_episode(variant, through):
    env, twin = FlapEnv(**_keywords(variant)), FlapEnv(**_keywords(variant))
    actions = np.random.default_rng(0).uniform(-1, 1, (20, 3)).astype(np.float32)
    options = {"azimuth": 0.3, "flap_angle": 0.02, "turbulence_intensity": 0.05}
    env.reset(seed=3, options=options)
    for action in actions[:8]:
        env.step(action)
    twin.set_state(THROUGH[through](env.get_state()))
    assert twin.np_random_seed == 3
    for action in actions[8:]:
        _assert_equal(twin.step(action), env.step(action))
    np.testing.assert_array_equal(twin.reset()[0], env.reset()[0])
    _assert_equal(twin.step(actions[0]), env.step(actions[0]))


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("count", [3, 17])
def test_many_turbines_go_on_bit_for_bit_through_their_autoresets(mode, count):
    keywords = _keywords("noise and lag")
    env, twin = (FlapVectorEnv(count, autoreset_mode=mode, **keywords) for _ in range(2))
    actions = np.random.default_rng(0).uniform(-1, 1, (50, count, 3)).astype(np.float32)
    env.reset(seed=3)
    for action in actions[:20]:
        env.step(action)
    twin.set_state(json.loads(json.dumps(env.get_state())))
    for action in actions[20:]:
        _assert_equal(twin.step(action), env.step(action))


def test_a_state_can_be_taken_again_and_again():
    env = FlapEnv(**_keywords("plain"))
    env.reset(seed=1)
    state = env.get_state()
    first = [env.step(np.full(3, 0.5))[1] for _ in range(5)]
    env.set_state(state)
    assert [env.step(np.full(3, 0.5))[1] for _ in range(5)] == first


@pytest.mark.parametrize(
    "other, named",
    [
        ({"steps_per_action": 7}, "steps_per_action"),
        ({"task": {"observe": ("rbm", "azimuth")}}, "task"),
        ({"model": synthetic_model(tower_coupling=0.5)}, "model"),
        ({"backend": "numpy"}, "backend"),
    ],
)
def test_a_state_of_another_environment_is_refused_by_name_and_changes_nothing(other, named):
    env, stranger = FlapEnv(**_keywords("plain")), FlapEnv(**(_keywords("plain") | other))
    for one in (env, stranger):
        one.reset(seed=1)
    before = env.get_state()
    with pytest.raises(ValueError, match=named):
        env.set_state(stranger.get_state())
    with pytest.raises(ValueError, match="get_state"):
        env.set_state({"rbm": 0.0})
    assert env.get_state() == before


DAMAGE = {
    "plant lost": lambda entry: entry.pop("plant"),
    "plant no table": lambda entry: entry.update(plant=3),
    "flaps lost": lambda entry: entry["plant"].pop("flaps"),
    "modes short": lambda entry: entry["plant"]["modes"].pop(),
    "flaps a text": lambda entry: entry["plant"].update(flaps="up"),
    "origin lost": lambda entry: entry.pop("origin"),
    "generator unknown": lambda entry: entry["origin"]["generator"].update(bit_generator="Dice"),
    "entry a number": lambda entry: entry.clear(),
    "time negative": lambda entry: entry["plant"].update(elapsed=-(10**11)),
    "time fractional": lambda entry: entry["plant"].update(elapsed=1.5),
    "time a text": lambda entry: entry["plant"].update(elapsed="1"),
    "time not a number": lambda entry: entry["plant"].update(elapsed=np.nan),
    "time past the end": lambda entry: entry["plant"].update(elapsed=21),
    "flap past its stop": lambda entry: entry["plant"]["flaps"][0].__setitem__(1, 0.2),
    "flap too fast": lambda entry: entry["plant"]["flaps"][1].__setitem__(1, -2.0),
    "flaps not numbers": lambda entry: entry["plant"]["flaps"][2].__setitem__(0, np.nan),
    "flaps one for all": lambda entry: entry["plant"].update(flaps=0.0),
    "flaps unequal": lambda entry: entry["plant"]["flaps"][0].pop(),
    "travel one for all": lambda entry: entry["plant"].update(travel=[0.0]),
    "travel infinite": lambda entry: entry["plant"].update(travel=[0.0, np.inf, 0.0]),
    "modes one for all": lambda entry: entry["plant"].update(modes=0.0),
    "modes not numbers": lambda entry: entry["plant"]["modes"].__setitem__(0, np.nan),
    "modes texts": lambda entry: entry["plant"].update(modes=["0"] * len(entry["plant"]["modes"])),
    "intensity negative": lambda entry: entry["origin"].update(turbulence_intensity=-1.0),
    "azimuth not a number": lambda entry: entry["origin"].update(azimuth=np.nan),
    "seed negative": lambda entry: entry["origin"].update(realisation_seed=-1),
    "first flap angle too large": lambda entry: entry["origin"].update(flap_angle=[9.0, 0.0, 0.0]),
}


@pytest.mark.parametrize("variant", ["plain", "numpy", "delay"])
@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_turbine_is_refused_and_changes_nothing(damage, variant):
    env, giver = (FlapVectorEnv(2, **_keywords(variant)) for _ in range(2))
    for seed, one in enumerate((env, giver)):
        one.reset(seed=seed)
        one.step(np.full((2, 3), 0.3))
    before, state = env.get_state(), giver.get_state()
    DAMAGE[damage](state["turbines"][1])  # the first is whole
    with pytest.raises(ValueError, match=r"^state: turbines: damaged .*; take it from get_state"):
        env.set_state(state)
    assert env.get_state() == before


@pytest.mark.parametrize(
    "many, name, value",
    [
        (False, "generator", {}),
        (False, "seed", None),
        (False, "seed", 1.5),
        (False, "running", "no"),
        (False, "turbines", [None]),
        (True, "ended", ["no", "no"]),
        (True, "started", [1, 1]),
        (True, "observation", [[np.nan] * 3] * 2),
        (True, "observation", 0.0),
        (True, "observation", [[1e300] * 3] * 2),
        (True, "turbines", [None, None]),
        (True, "turbines", 2),
        (True, "generators", [{}, {}]),
        (True, "seeds", [1]),
        (True, "ended", [True]),
        (True, "observation", [[0.0]]),
        (True, "turbines", []),
    ],
)
def test_what_else_is_damaged_is_named_and_changes_nothing(many, name, value):
    env = FlapVectorEnv(2, **_keywords("plain")) if many else FlapEnv(**_keywords("plain"))
    env.reset(seed=0)
    before = env.get_state()
    # An environment without an episode is whole; what contradicts it is the other entry.
    blamed = {"[None]": "running", "[None, None]": "started"}.get(str(value), name)
    with pytest.raises(ValueError, match=rf"^state: {blamed}: damaged .*; take it from get_state"):
        env.set_state(before | {name: value})
    assert env.get_state() == before


@pytest.mark.parametrize("through", THROUGH)
def test_what_is_done_to_a_state_reaches_neither_giver_nor_taker(through):
    env, twin = FlapEnv(**_keywords("delay")), FlapEnv(**_keywords("delay"))
    env.reset(seed=0)
    before, state = THROUGH[through](env.get_state()), env.get_state()
    twin.set_state(state)
    state["made_by"].clear()
    state["generator"].clear()
    origin = state["turbines"][0]["origin"]
    origin["generator"]["state"].clear()
    origin["flap_angle"][0] = 9.0
    state["turbines"][0]["plant"]["flaps"][0][0] = 9.0
    assert env.get_state() == before
    assert twin.get_state() == before


def test_late_moments_of_a_damaged_state_are_refused():
    env = FlapEnv(**_keywords("delay"))
    env.reset(seed=0)
    for past in (0.0, [[0.0] * 3], [[np.nan] * 3] * 2):
        state = env.get_state()
        state["turbines"][0]["plant"]["past"] = past
        with pytest.raises(ValueError, match=r"damaged \(turbine 0: past: expected"):
            env.set_state(state)


KINDS = ("MT19937", "PCG64", "PCG64DXSM", "Philox", "SFC64")


@pytest.mark.parametrize("kind", KINDS)
def test_the_state_of_any_generator_of_numpy_survives_json(kind):
    env, twin = FlapEnv(**_keywords("plain")), FlapEnv(**_keywords("plain"))
    env.np_random = np.random.Generator(getattr(np.random, kind)(3))
    env.reset()
    env.step(np.zeros(3))
    twin.set_state(json.loads(json.dumps(env.get_state())))
    _assert_equal(twin.step(np.zeros(3)), env.step(np.zeros(3)))
    np.testing.assert_array_equal(twin.reset()[0], env.reset()[0])


@pytest.mark.parametrize("kind, damage", [("MT19937", "pos"), ("Philox", "buffer_pos"), ("SFC64", "state")])
def test_a_damaged_generator_is_refused(kind, damage):
    env = FlapEnv(**_keywords("plain"))
    env.np_random = np.random.Generator(getattr(np.random, kind)(3))
    env.reset()
    state = env.get_state()
    entry = state["generator"] if damage in state["generator"] else state["generator"]["state"]
    entry[damage] = 10**6
    with pytest.raises(ValueError, match="^state: generator: damaged"):
        env.set_state(state)


def test_a_late_environment_refuses_the_state_of_another_backend():
    env, stranger = (FlapEnv(**_keywords("delay"), backend=backend) for backend in ("numpy", "numba"))
    for one in (env, stranger):
        one.reset(seed=1)
    with pytest.raises(ValueError, match="backend"):
        env.set_state(stranger.get_state())


@pytest.mark.parametrize("to_many", [False, True])
def test_one_environment_and_a_vector_of_one_refuse_each_others_states(to_many):
    env, stranger = FlapEnv(**_keywords("plain")), FlapVectorEnv(1, **_keywords("plain"))
    for seed, one in enumerate((env, stranger)):
        one.reset(seed=seed)
    taker, giver = (stranger, env) if to_many else (env, stranger)
    before = taker.get_state()
    with pytest.raises(ValueError, match="get_state"):
        taker.set_state(giver.get_state())
    assert taker.get_state() == before


def test_environments_of_a_process_share_their_pool_of_realisations():
    keywords = _keywords("pool")
    alone, one, many = (
        FlapEnv(**_keywords("plain")),
        FlapEnv(**keywords),
        FlapVectorEnv(4, **keywords),
    )
    assert one._turbines.plant.episode.responses is many._turbines.plant.episode.responses
    options = {"realisation_seed": 2, "azimuth": 0.0}
    _, expected = alone.reset(seed=0, options=options)
    for env in (one, many):
        _, info = env.reset(seed=9, options=options)
        np.testing.assert_allclose(np.atleast_2d(info["rbm"])[0], expected["rbm"], rtol=1e-12)
    drawn = {round(one.reset(seed=seed)[1]["wind_perturbation"], 9) for seed in range(30)}
    assert len(drawn) == 3
    with pytest.raises(ValueError, match="seeds 0 to 2"):
        one.reset(options={"realisation_seed": 3})


@pytest.mark.parametrize("backend", ["numpy", "numba"])
def test_a_copy_shares_the_pool_of_realisations(backend):
    env = FlapEnv(**_keywords("pool"), backend=backend)
    env.reset(seed=0, options={"realisation_seed": 0})
    twin = copy.deepcopy(env)
    assert twin._turbines.plant.episode.responses is env._turbines.plant.episode.responses
    for one in (env, twin):  # a realisation that neither had when it was copied
        one.reset(seed=1, options={"realisation_seed": 2})
    _assert_equal(twin.step(np.ones(3)), env.step(np.ones(3)))


def test_each_environment_has_the_intensity_given_for_it():
    env = FlapVectorEnv(3, model=synthetic_model(), wind={"turbulence_intensity": (0.05, 0.10, 0.0)})
    options = {"realisation_seed": 5, "azimuth": 0.0}
    _, info = env.reset(seed=0, options=options)
    wind = info["wind_perturbation"]
    np.testing.assert_allclose(wind, [0.5 * wind[1], wind[1], 0.0])
    _, info = env.reset(options=options | {"turbulence_intensity": 0.2})
    np.testing.assert_allclose(info["wind_perturbation"], 2.0 * wind[1])
    with pytest.raises(ValueError, match="turbulence_intensity"):
        env.reset(options={"turbulence_intensity": -0.1})


@pytest.mark.parametrize("value", [(0.1, 0.1), (0.1, 1.0, 0.1), "0.1", [0.1, np.nan, 0.1]])
def test_impossible_intensities_are_refused(value):
    with pytest.raises(ValueError, match="turbulence_intensity"):
        FlapVectorEnv(3, model=synthetic_model(), wind={"turbulence_intensity": value})


def test_single_precision_gives_the_trajectories_of_double():
    steps = []
    for precision in ("float64", "float32"):
        env = FlapVectorEnv(20, model=synthetic_model(), precision=precision)
        env.reset(seed=4)
        actions = np.random.default_rng(1).uniform(-1, 1, (60, 20, 3))
        steps.append([env.step(action)[4]["rbm"] for action in actions])
    expected, got = map(np.array, steps)
    assert np.abs(got - expected).max() < 1e-4 * np.sqrt(np.mean(expected**2))
