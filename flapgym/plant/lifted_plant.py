"""The linear turbine stepped by numpy, a whole interval in one product: the plant where numba is missing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.core.arrays import Array
from flapgym.model.multiblade import blade_azimuths, to_blades, to_components
from flapgym.model.turbine_model import TurbineModel
from flapgym.plant.interface import Interval, Setup, Start, Task
from flapgym.plant.kernel import prepare
from flapgym.plant.layout import FLAP_INPUTS
from flapgym.plant.responses import Responses
from flapgym.plant.sampled import SampledPlant
from flapgym.plant.stuck import first_modes


class LiftedPlant(SampledPlant):
    """n turbines by superposition: the flaps' response is stepped, the wind's is read from a table.

    Parameters
    ----------
    model : TurbineModel
    count : int
        Number of turbines n.
    setup : Setup
    task : Task
    """

    def __init__(self, model: TurbineModel, count: int, setup: Setup, task: Task) -> None:
        super().__init__(model, count, setup, task)
        kernel = prepare(
            model, setup.steps_per_action, setup.length_scale, setup.every_sample, setup.single_blade
        )
        flap, dtype = kernel.lifted, np.dtype(setup.precision)
        self._kernel = kernel
        self._decay = flap.decay.astype(np.result_type(dtype, np.complex64))
        # The last sample's motion acts on the outputs alone.
        self._drive = flap.drive[:-FLAP_INPUTS].astype(dtype)
        self._read = np.vstack([flap.read, flap.feed]).astype(dtype)
        # Modes and flap components side by side, so that one product reads both.
        self._state = np.zeros((count, self._read.shape[0]), dtype=dtype)
        self._responses = Responses(kernel, count, setup, model.turbulence_intensity)
        self._effectiveness = np.array(setup.faults.effectiveness)[: setup.blades]

    @property
    def noise_count(self) -> int:
        """Standard normal numbers one turbine's realisation takes."""
        return self._kernel.disturbance.noise_count(self.setup.intervals)

    def begin(self, turbines: NDArray[np.int64], start: Start) -> Interval:
        """Begin an episode of m turbines; the outputs at sample 0."""
        first = self._responses.draw(turbines, start)
        modes = first_modes(self._kernel.flap, self.setup, start.azimuth, self._kernel.turn)
        self._state[turbines, : 2 * self._decay.size] = modes.view(float)
        first[:, :8] += (modes @ self._kernel.flap.read.T).real
        first[:, :8] += first_motion(start, self._effectiveness) @ self._kernel.direct
        return first_interval(first, start, self.setup.blades)

    def advance(self, motion: Array, stopped: NDArray[np.bool_]) -> Interval:
        """Go on under flap motion (n, 2 (k + 1), blades)."""
        kernel, n, k, blades = self._kernel, self.count, self.setup.steps_per_action, self.setup.blades
        transform = _transform(self.azimuth, blades)
        weights = (np.array([[1.0], [2.0], [2.0]]) / 3.0 if blades == 3 else 1.0) * self._effectiveness
        size = 2 * self._decay.size
        # Views are taken here and not kept: a copied or pickled plant would lose them.
        modes, components = self._state[:, :size].view(self._decay.dtype), self._state[:, size:]
        components[:] = (motion @ (transform * weights).transpose(0, 2, 1)).reshape(n, -1)
        rows = (self._state @ self._read).astype(float)
        elapsed = np.minimum(self.elapsed, self.setup.intervals - 1)
        rows += self._responses.rows[self._responses.place, elapsed] * self._responses.level[:, None]
        modes *= self._decay
        modes += (components[:, : self._drive.shape[0]] @ self._drive).view(self._decay.dtype)
        loads = rows[:, : kernel.rows.blade_rows].reshape(n, -1, 3) @ transform
        flat = rows[:, kernel.rows.blade_rows :].reshape(n, kernel.rows.kept, 3)
        return Interval(
            rbm=loads[:, :k],
            tip_deflection=loads[:, k:],
            tower=flat[:, :, :2],
            wind=flat[:, :, 2],
            flap_angle=motion[:, 0::2],
            flap_rate=motion[:, 1::2],
            stopped=stopped,
        )

    def get_state(self, turbine: int) -> dict[str, Any]:
        """What changes of a turbine, but for its realisation, as plain values for JSON."""
        modes = self._state[turbine, : 2 * self._decay.size]
        return super().get_state(turbine) | {"modes": modes.astype(float).tolist()}

    def set_state(self, turbine: int, state: dict[str, Any]) -> None:
        """Go on from there; `reset` with the same realisation comes before."""
        super().set_state(turbine, state)
        self._state[turbine, : 2 * self._decay.size] = state["modes"]


def _transform(azimuth: Array, blades: int) -> Array:
    """(n, 3 components, blades): one, cosine and sine of each blade's azimuth; a single blade is the mean."""
    transform = np.zeros((azimuth.size, 3, blades))
    transform[:, 0] = 1.0
    if blades == 3:
        angle = blade_azimuths(azimuth)
        np.cos(angle, out=transform[:, 1])
        np.sin(angle, out=transform[:, 2])
    return transform


def first_motion(start: Start, effectiveness: Array) -> Array:
    """Flap angle and rate in components (m, 6) at sample 0."""
    blades = effectiveness.size
    parts = []
    for values in (start.flap_angle, start.flap_rate):
        acting = values[:, :blades] * effectiveness
        parts.append(
            to_components(acting, start.azimuth) if blades == 3 else np.pad(acting, ((0, 0), (0, 2)))
        )
    return np.concatenate(parts, axis=1)


def first_interval(outputs: Array, start: Start, blades: int) -> Interval:
    """Outputs (m, 9) at sample 0 as an interval of one sample."""
    loads = outputs[:, :6].reshape(-1, 2, 3)
    loads = to_blades(loads, start.azimuth[:, None]) if blades == 3 else loads[:, :, :1]
    return Interval(
        rbm=loads[:, :1],
        tip_deflection=loads[:, 1:],
        tower=outputs[:, None, 6:8],
        wind=outputs[:, 8:],
        flap_angle=start.flap_angle[:, None, :blades],
        flap_rate=start.flap_rate[:, None, :blades],
        stopped=np.zeros((outputs.shape[0], blades), dtype=bool),
    )
