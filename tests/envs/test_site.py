"""Environments in a field and at a site: what a seed means, and what is refused."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from flapgym.envs import FlapEnv, FlapVectorEnv
from flapgym.envs.registration import ENVIRONMENTS
from flapgym.plant.responses import realisation_azimuth

SITES = {
    entry.id: entry
    for entry in ENVIRONMENTS
    if entry.id.split("/")[1].startswith(("NREL5MWField", "NREL5MWSite", "NREL5MWThree"))
}
SITE = dict(SITES["flapgym/NREL5MWSite-v0"].keywords)
SHORT = {"duration": 0.7, "backend": "numpy"}


def pooled(pool):
    return SITE | SHORT | {"wind": {**SITE["wind"], "pool": pool}}


def flown(env, seed, options=None):
    """Observations of an episode under the same random actions, the first of the reset."""
    rng = np.random.default_rng(3)
    seen = [env.reset(seed=seed, options=options)[0]]
    shape = env.action_space.shape
    for _ in range(10):
        actions = np.broadcast_to(rng.uniform(-1.0, 1.0, shape[-1]), shape).astype(np.float32)
        seen.append(env.step(actions)[0])
    return np.array(seen)


@pytest.mark.parametrize("name", sorted(SITES))
def test_the_same_seed_is_the_same_episode_and_another_seed_another(name):
    env, twin = (gymnasium.make(name, **SHORT) for _ in range(2))
    expected = flown(env, 5)
    np.testing.assert_array_equal(flown(twin, 5), expected)
    np.testing.assert_array_equal(flown(env, 5), expected)
    assert not np.allclose(flown(env, 6)[0], expected[0])


@pytest.mark.parametrize("pool", [0, 4])
def test_one_turbine_of_several_is_the_one_alone(pool):
    keywords = pooled(pool)
    several = flown(FlapVectorEnv(3, **keywords), [7, 8, 9])
    for turbine, seed in enumerate([7, 8, 9]):
        alone = flown(FlapEnv(**keywords), seed)
        np.testing.assert_allclose(several[:, turbine], alone, rtol=1e-5, atol=1e-6)


def test_a_realisation_of_a_pool_begins_at_its_own_azimuth():
    env = FlapEnv(**pooled(5), full_info=True)
    for number in (0, 3, 4):
        _, info = env.reset(seed=1, options={"realisation_seed": number})
        assert info["azimuth"] == pytest.approx(float(realisation_azimuth(number)), abs=1e-12)


def test_azimuths_of_a_pool_are_spread_evenly_over_the_turn():
    azimuth = np.sort(realisation_azimuth(np.arange(34)))
    gaps = np.diff(np.append(azimuth, azimuth[0] + 2.0 * np.pi))
    # By the golden ratio no gap is twice the mean; drawn at random the largest of 34 would be about four of them.
    assert gaps.max() < 2.0 * (2.0 * np.pi / 34)


def test_a_realisation_of_a_pool_is_that_of_its_seed_at_its_azimuth():
    alone = flown(FlapEnv(**pooled(0)), 1, {"realisation_seed": 3, "azimuth": float(realisation_azimuth(3))})
    got = flown(FlapEnv(**pooled(5)), 1, {"realisation_seed": 3})
    np.testing.assert_allclose(got, alone, rtol=1e-5, atol=1e-6)


def test_an_azimuth_is_refused_where_realisations_of_a_pool_have_their_own():
    env = FlapEnv(**pooled(4))
    with pytest.raises(ValueError, match=r"^options\.azimuth: expected none .*pool"):
        env.reset(options={"azimuth": 1.0})


def test_a_turbulence_intensity_is_refused_at_a_reset_in_a_field():
    env = FlapEnv(**SITE, **SHORT)
    with pytest.raises(ValueError, match=r"^options\.turbulence_intensity: expected none beside wind\.field"):
        env.reset(options={"turbulence_intensity": 0.1})


REFUSED = {
    "intensity beside a field": (
        SITE | {"wind": {**SITE["wind"], "turbulence_intensity": 0.1}},
        r"^wind\.turbulence_intensity: expected None beside a field",
    ),
    "field without strips": (
        {"model": "nrel5mw-corrected", "wind": {"field": {"kind": "von_karman"}}},
        r"^wind\.field: expected a model with winds by strip, .*got nrel5mw-corrected",
    ),
    "inflow without strips": (
        {"model": "nrel5mw-corrected", "wind": {"inflow": {"shear_exponent": 0.2}}},
        r"^wind\.inflow: expected a model with winds by strip, .*got nrel5mw-corrected",
    ),
    "gravity not an input": (
        {"model": "nrel5mw-corrected", "gravity": True},
        r"^gravity: expected a model with gravity as an input, .*got nrel5mw-corrected",
    ),
    "field on a heavy blade": (
        {"model": "nrel5mw-corrected-heavy-blade", "wind": {"field": {"kind": "von_karman"}}},
        r"^wind\.field: expected a model .*got nrel5mw-corrected-heavy-blade",
    ),
    "gravity on a heavy blade": (
        {"model": "nrel5mw-corrected-heavy-blade", "gravity": True},
        r"^gravity: expected a model .*got nrel5mw-corrected-heavy-blade",
    ),
    "field on a single blade": (
        {"model": "nrel5mw-site", "wind": {"field": {"kind": "von_karman"}}, "single_blade": True},
        r"^wind\.field: expected none with single_blade=True",
    ),
    "inflow on a single blade": (
        {"model": "nrel5mw-site", "wind": {"inflow": {"shear_exponent": 0.2}}, "single_blade": True},
        r"^wind\.inflow: expected none with single_blade=True",
    ),
    "gravity on a single blade": (
        {"model": "nrel5mw-site", "gravity": True, "single_blade": True},
        r"^gravity: expected none with single_blade=True",
    ),
}


@pytest.mark.parametrize("given", REFUSED.values(), ids=REFUSED)
def test_what_does_not_go_together_is_refused_in_one_line_that_names_it(given):
    keywords, line = given
    with pytest.raises(ValueError, match=line) as refusal:
        FlapEnv(**keywords, **SHORT)
    assert "\n" not in str(refusal.value)
