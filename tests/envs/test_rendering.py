"""The picture shows the turbine."""

from __future__ import annotations

import copy
import pickle

import gymnasium
import numpy as np
import pytest

from flapgym.envs import FlapEnv, FlapVectorEnv
from flapgym.envs.disk import Raster, azimuths
from flapgym.envs.rendering import HUB, REACH, SCALE_PLACE, SCALE_WIDTH, _place, _round_step
from flapgym.plant import LinearPlant

pygame = pytest.importorskip("pygame")


def _run(env, actions):
    env.reset(seed=0, options={"azimuth": 0.0})
    for action in actions:
        env.step(action)
    return env


def test_a_frame_is_a_picture_that_changes_with_the_state(model_file):
    env = gymnasium.make("flapgym/NREL5MW-v1", model=model_file, render_mode="rgb_array")
    still = _run(env, np.zeros((30, 3))).render()
    moved = _run(env, np.tile([1.0, 0.0, -1.0], (30, 1))).render()
    assert still.shape == (480, 640, 3)
    assert still.dtype == np.uint8
    assert (still != moved).any()
    # Red for a flap that adds lift, blue for one that takes it away.
    assert ((moved == (200, 40, 40)).all(axis=2)).sum() > ((still == (200, 40, 40)).all(axis=2)).sum()
    env.close()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_pictures_of_a_vector_are_those_of_its_environments_through_an_autoreset(model_file, mode):
    keywords = {"model": model_file, "duration": 0.2, "render_mode": "rgb_array"}
    mode = gymnasium.vector.AutoresetMode(mode)
    many = gymnasium.make_vec("flapgym/NREL5MW-v1", num_envs=2, autoreset_mode=mode, **keywords)
    each = gymnasium.vector.SyncVectorEnv([lambda: FlapEnv(**keywords)] * 2, autoreset_mode=mode)
    for env in (many, each):
        env.reset(seed=0)
        for _ in range(9):  # episodes take six actions
            env.step(np.tile(np.float32([0.5, 0.0, -0.5]), (2, 1)))
    frames = many.render()
    assert isinstance(frames, tuple)
    assert (frames[0] != frames[1]).any()
    np.testing.assert_array_equal(frames, each.render())


COPIED = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}


@pytest.mark.parametrize("copied", COPIED)
@pytest.mark.parametrize("many", [False, True])
def test_a_copy_of_an_environment_with_pictures_goes_on_as_the_original(model_file, many, copied):
    keywords = {"model": model_file, "render_mode": "rgb_array"}
    env = FlapVectorEnv(2, **keywords) if many else FlapEnv(**keywords)
    action = np.full(env.action_space.shape, 0.4, dtype=np.float32)
    _run(env, [action] * 8)
    twin = COPIED[copied](env)
    np.testing.assert_array_equal(env.render(), twin.render())
    for one in (env, twin):
        one.step(-action)
    np.testing.assert_array_equal(env.render(), twin.render())


def test_a_copy_of_an_environment_with_a_window_leaves_the_window(model_file):
    env = _run(FlapEnv(model=model_file, render_mode="human"), np.zeros((3, 3)))
    twin = copy.deepcopy(env)
    twin.close()
    assert pygame.display.get_init()
    env.close()


LEFT = np.s_[:, :310]
"""The rotor, flaps, time and azimuth; the traces are to the right."""


@pytest.mark.parametrize("single_blade", [False, True])
@pytest.mark.parametrize("cls", [FlapEnv, FlapVectorEnv])
def test_after_a_state_the_picture_is_of_that_instant(model_file, cls, single_blade):
    many = issubclass(cls, FlapVectorEnv)

    def make():
        count = {"num_envs": 1} if many else {}
        return cls(**count, model=model_file, single_blade=single_blade, render_mode="rgb_array")

    def picture(one):
        return one.render()[0] if many else one.render()

    env, twin, blank = make(), make(), picture(make())
    action = np.full(env.action_space.shape, 0.4, dtype=np.float32)
    for one, steps in ((env, 30), (twin, 5)):
        one.reset(seed=steps)
        for _ in range(steps):
            one.step(action)
    twin.set_state(env.get_state())
    # All but the wind, which is not known before the next step.
    np.testing.assert_array_equal(picture(twin)[LEFT][:445], picture(env)[LEFT][:445])
    for one in (env, twin):
        one.step(action)
    np.testing.assert_array_equal(picture(twin)[LEFT], picture(env)[LEFT])
    twin.set_state(make().get_state())
    np.testing.assert_array_equal(picture(twin), blank)


def test_a_vector_has_no_window(model_file):
    with pytest.raises(ValueError, match=r'render_mode: expected None or "rgb_array", got \'human\''):
        FlapVectorEnv(2, model=model_file, render_mode="human")


def test_a_trace_of_any_reach_has_lines_on_each_side():
    for reach in (*np.geomspace(0.01, 1000.0, 301), 8.0, 9.99):
        assert 1.0 < reach / _round_step(reach) < 4.0


def test_seen_from_upwind_the_rotor_turns_clockwise():
    top, later = _place(0.0, 1.0, 0.0), _place(0.1, 1.0, 0.0)
    assert later[0] > top[0]


def test_human_mode_opens_and_closes(model_file):
    env = gymnasium.make("flapgym/NREL5MW-v1", model=model_file, render_mode="human")
    _run(env, np.zeros((3, 3)))
    assert pygame.display.get_init()
    env.close()
    assert not pygame.display.get_init()


def test_rendering_without_a_mode_says_what_is_missing(model_file):
    env = gymnasium.make("flapgym/NREL5MW-v1", model=model_file)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        env.unwrapped.render()


SITE = {
    "model": "nrel5mw-site",
    "wind": {"field": {"kind": "kaimal", "turbulence_class": "B"}, "inflow": {"shear_exponent": 0.2}},
}
FIELD = {"model": "nrel5mw-site", "wind": {"field": {"kind": "von_karman"}}}


def _disk_and_scale(frame):
    """Columns of the disk's pixels, blades, tower and hub among them, and the colours of the scale."""
    left, top = round(HUB[0] - REACH), round(HUB[1] - REACH)
    (x, y), size = SCALE_PLACE, round(2 * REACH) + 1
    return frame[top : top + size, left : left + size], frame[y + 4, x + 1 : x + SCALE_WIDTH - 1]


def _wind_of(frame, most):
    """Wind (D, D) [m/s] that the scale gives the disk's colours; NaN where no colour of it is near, and outside."""
    disk, scale = (part.astype(float) for part in _disk_and_scale(frame))
    away = np.linalg.norm(disk[:, :, None] - scale, axis=-1)
    wind = np.linspace(-most, most, len(scale))[away.argmin(axis=-1)]
    down, right = np.mgrid[-1.0 : 1.0 : len(disk) * 1j, -1.0 : 1.0 : len(disk) * 1j]
    return np.where((away.min(axis=-1) < 4.0) & (np.hypot(down, right) < 0.99), wind, np.nan)


def _begun(keywords, actions, seed=4, cls=FlapEnv):
    env = cls(**keywords, render_mode="rgb_array", full_info=True, duration=4.0)
    info = env.reset(seed=seed)[1]
    for _ in range(actions):
        info = env.step(np.zeros(3, dtype=np.float32))[-1]
    return env, info


@pytest.mark.parametrize("actions", [0, 40])
def test_the_colours_of_the_disk_are_on_average_the_wind_over_the_disk(actions):
    env, info = _begun(FIELD, actions)
    model = env.model
    wind = _wind_of(env.render(), 3.0 * model.turbulence_intensity * model.wind_speed)
    assert np.isfinite(wind).mean() > 0.6
    # Blades and tower hide some of it; the scale has 90 steps of 0.07 m/s.
    assert np.nanmean(wind) == pytest.approx(info["wind_perturbation"], abs=0.1)
    assert np.nanstd(wind) > 0.3


def test_a_gust_beside_a_field_is_in_the_colours():
    gust = {"kind": "step", "size": 1.5, "start": 1.0}
    keywords = {**FIELD}
    alone, _ = _begun(keywords, 40)
    with_gust, _ = _begun(keywords | {"wind": {**keywords["wind"], "gust": gust}}, 40)
    most = 3.0 * alone.model.turbulence_intensity * alone.model.wind_speed
    risen = _wind_of(with_gust.render(), most) - _wind_of(alone.render(), most)
    # The ends of the scale cut some of it off.
    assert np.nanmedian(risen) == pytest.approx(1.5, abs=0.1)


def test_under_shear_the_wind_is_fast_above_and_slow_below():
    calm = {"kind": "von_karman", "turbulence_intensity": 1e-3}
    env, _ = _begun({"model": "nrel5mw-site", "wind": {"field": calm, "inflow": {"shear_exponent": 0.2}}}, 3)
    disk, scale = _disk_and_scale(env.render())
    middle = len(disk) // 2
    above, below = disk[15, middle + 20].astype(float), disk[-15, middle + 20].astype(float)
    slow, fast = scale[0].astype(float), scale[-1].astype(float)
    assert np.linalg.norm(above - fast) < np.linalg.norm(above - slow)
    assert np.linalg.norm(below - slow) < np.linalg.norm(below - fast)


@pytest.mark.parametrize("pool", [0, 3])
def test_the_picture_of_a_field_is_that_of_its_seed_through_states_copies_and_vectors(pool):
    keywords = SITE | {"wind": {**SITE["wind"], "pool": pool}}
    env, _ = _begun(keywords, 30)
    frame = env.render()
    other, _ = _begun(keywords, 3, seed=9)
    other.set_state(env.get_state())
    many = FlapVectorEnv(2, **keywords, render_mode="rgb_array", duration=4.0)
    many.reset(seed=[8, 4])
    for _ in range(30):
        many.step(np.zeros((2, 3), dtype=np.float32))
    np.testing.assert_array_equal(copy.deepcopy(env).render(), frame)
    np.testing.assert_array_equal(many.render()[1][LEFT], frame[LEFT])
    # All but the wind in figures, which is not known before the next step.
    np.testing.assert_array_equal(other.render()[LEFT][:445], frame[LEFT][:445])


def test_the_field_of_an_episode_is_made_again_once_and_only_for_a_picture(monkeypatch):
    made = []
    of_plant = LinearPlant.field
    monkeypatch.setattr(LinearPlant, "field", lambda *given: made.append(1) or of_plant(*given))
    env, _ = _begun(SITE, 5)
    assert not made
    env.render()
    env.render()
    assert len(made) == 1
    env.reset(seed=5)
    env.render()
    assert len(made) == 2


def test_a_blade_is_drawn_on_the_wind_of_its_azimuth():
    radii = np.array([10.0, 30.0, 50.0])
    raster = Raster.of(radii, 60.0, 120)
    wind = np.cos(azimuths() - 1.0) * radii[:, None]
    image = np.full(raster.inside.shape, np.nan)
    image[raster.inside] = raster.values(wind)
    for azimuth in np.linspace(0.0, 2.0 * np.pi, 7):
        x, y = _place(azimuth, 2.0 / 3.0, 0.0)  # 40 m, between two rings
        right, down = (x - HUB[0]) * 120 / REACH, (y - HUB[1]) * 120 / REACH
        met = image[120 + round(right), 120 + round(down)]
        assert met == pytest.approx(40.0 * np.cos(azimuth - 1.0), abs=0.6)  # a pixel is 0.5 m
