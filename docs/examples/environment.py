"""An environment of one's own: a weak flap, late sensors and a gust under an id, without a class."""

import gymnasium

import flapgym  # registers the others

gymnasium.register(
    id="mine/WeakFlapInGust-v0",
    entry_point="flapgym.envs.single:FlapEnv",
    vector_entry_point="flapgym.envs.vector:FlapVectorEnv",
    kwargs={
        "wind": {"gust": {"kind": "step", "size": 2.0, "start": 5.0}, "turbulence_intensity": 0.05},
        "task": {"observe": ["rbm", "flap_angle"], "flap_angle_weight": 0.1},
        "actuators": {"effectiveness": [1.0, 1.0, 0.6]},
        "sensors": {"delay": 0.014},
    },
    order_enforce=False,  # it checks the order of calls and its actions by itself,
    disable_env_checker=True,  # and Gymnasium's wrappers for that would cost a tenth of a step
)

env = gymnasium.make("mine/WeakFlapInGust-v0", duration=10.0)
many = gymnasium.make_vec("mine/WeakFlapInGust-v0", num_envs=4)
observation, info = env.reset(seed=1)
print(f"flapgym {flapgym.__version__}: one observes {observation.shape}, four {many.reset(seed=1)[0].shape}")
