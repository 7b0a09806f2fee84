"""The clamped single blade as an environment: one flap, one moment, the paper's design model."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

from flapgym.envs.fleet import Info, numbers
from flapgym.envs.observation import DISPLACEMENTS
from flapgym.envs.single import FlapEnv
from flapgym.envs.vector import FlapVectorEnv


class BladeEnv(FlapEnv):
    """Load alleviation on one blade of the NREL 5 MW turbine, clamped at its root and turning alone in its own wake.

    ## Description

    The design model of Ng et al., on which their controllers are made: a rotating blade in homogeneous turbulence with
    one trailing-edge flap over 20 % of its lifting span and 10 % of its chord, without tower, shaft and neighbours. It
    has a third of the turbine's states and one of everything, for quick study; what is learnt on it can be tried on the
    turbine, blade by blade. It does not know azimuth.

    ## Action Space

    `Box(-1, 1, (1,), float32)`: acceleration of the flap as a fraction of the model's `acceleration_limit`
    (600 deg/s^2), held for `steps_per_action` plant steps of 0.007 s. All else is as for the turbine.

    ## Observation Space

    `Box` of float32, in the order of the keyword `observe`; values beyond the bounds are clipped.

    | name | entries | unit | bound | meaning |
    |---|---|---|---|---|
    | `rbm` | 1 | MN m | 50, or 40 `rbm_rms` if more | flapwise root bending moment |
    | `flap_angle` | 1 | rad | angle stop, 0.1745 | flap angle |
    | `flap_rate` | 1 | rad/s | rate stop, 1.745 | flap rate |
    | `tip_deflection` | 1 | m | 50 | tip deflection, downwind |
    | `wind` | 1 | m/s | 50 | wind perturbation along the shaft |

    ## Rewards

    `reward_rbm + reward_flap_angle` as for the turbine. The moment's constant is the open-loop rms of this blade in the
    model's reference turbulence, so that doing nothing earns about -1 a step on average here too.

    ## Starting State

    Stationary turbulence and the blade's stationary response to it; flap at rest in the middle. `reset` takes the
    turbine's `options`, of which `azimuth` has no effect.

    ## Episode End

    `truncated` after `duration`, rounded up to whole actions; `terminated` only if the state ceases to be finite.

    ## Information

    As for the turbine, without `tower_top` and `azimuth`; what is one a blade there has shape (1,).

    ## Arguments

    Those of the turbine. `stuck_flaps` and `flap_effectiveness` have three entries here too, of which the first counts;
    `tower_weight` must be zero.

    ## Version History

    - v1: a blade of the turbine as published, model `nrel5mw-corrected`.
    - v0: a blade of the turbine as the paper reads it, model `nrel5mw-rated`.
    """

    single_blade = True

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float32], float, bool, bool, Info]:
        """Hold the flap acceleration (1,) for `steps_per_action` plant steps."""
        if not self._running:
            raise ResetNeeded("step: no episode is running; call reset first")
        values = numbers(action, self.action_space.shape or ())
        observation, reward, terminated, truncated, infos = self._fleet.step(values[None])
        info = _only(
            {
                name: value
                for name, value in infos.items()
                if self.settings.full_info or name not in DISPLACEMENTS
            }
        )
        end = bool(terminated[0]), bool(truncated[0])
        self._running = not any(end)
        if self._screen is not None:
            self._show(info)
        return observation[0], float(reward[0]), *end, info


class BladeVectorEnv(FlapVectorEnv):
    """Many clamped blades at once; task and keywords are those of `BladeEnv`, all else as in `FlapVectorEnv`."""

    single_blade = True


def _only(infos: Info) -> Info:
    """The only blade's row of every array; numbers as plain floats."""
    row: dict[str, Any] = {}
    for name, value in infos.items():
        if isinstance(value, dict):
            row[name] = {sample: part[0] for sample, part in value.items()}
        else:
            row[name] = value[0] if value.ndim > 1 else float(value[0])
    return row
