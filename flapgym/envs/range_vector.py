"""Many turbines at once, each from cut-in to cut-out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.envs.range_turbines import RangeTurbines
from flapgym.envs.settings import Settings
from flapgym.envs.turbines import Info
from flapgym.envs.vector import NO_TURBINES, FlapVectorEnv
from flapgym.envs.wind_speeds import chosen_set, speeds_within


class FlapRangeVectorEnv(FlapVectorEnv):
    """Many turbines at once, each at a wind speed of its own in each episode: those of `FlapRangeEnv`.

    It is to `FlapRangeEnv` what `FlapVectorEnv` is to `FlapEnv`: the same trajectories for the same seeds, with s + i
    for environment i, the same autoreset modes and masks. `info["wind_speed"]` (num_envs,) tells the wind speeds, and
    the option `wind_speed` of a reset may have one for each. `model` is that at the lowest of them, `models` the set.

    Parameters
    ----------
    num_envs, autoreset_mode, render_mode
        As for `FlapVectorEnv`.
    **keywords
        Those of `FlapRangeEnv`.
    """

    _turbines: RangeTurbines

    def _made(self, keywords: dict[str, Any], count: int) -> RangeTurbines:
        self.models = chosen_set(keywords.pop("model", "nrel5mw-range"))
        self.wind_speeds = speeds_within(self.models, keywords.pop("wind_speed", None))
        lowest = self.models.at(self.wind_speeds[0])
        settings = Settings.of(keywords | {"model": lowest}, type(self).__name__)
        return RangeTurbines(self.models, self.wind_speeds, settings, count)

    def set_state(self, state: Mapping[str, Any]) -> None:
        """As `FlapVectorEnv.set_state`."""
        super().set_state(state)
        self._tell_screens(np.arange(self.num_envs))

    def _show(
        self, info: Info, begun: NDArray[np.int64] = NO_TURBINES, turbines: NDArray[np.int64] | None = None
    ) -> None:
        self._tell_screens(begun)
        super()._show(info, begun, turbines)

    def _tell_screens(self, turbines: NDArray[np.int64]) -> None:
        """Tell the pictures which models the turbines that begin anew fly on."""
        for turbine in turbines if self._screens else ():
            self._screens[turbine].model = self._turbines.model_of(turbine)
