"""Model predictive control with the flaps' stops as constraints, on each blade; with or without a preview of the wind.

While no stop is in sight it is the LQG of the same weights and design model to rounding. Where one is, an active-set
solver finds the nearest offsets that keep angle, rate and acceleration within their limits over the horizon
(`flapgym.control.horizon`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flapgym.control.agent import Floats, blade_entries, by_blade
from flapgym.control.blade_controller import OBSERVED, acceleration_limits
from flapgym.control.channels import BLADE
from flapgym.control.closed_loop import require_flaps
from flapgym.control.horizon import BLOCKS, condense, innovations
from flapgym.control.lqg import (
    FILTER_ORDER,
    DesignModel,
    Weights,
    design_model,
    flap_units,
    initial_estimate,
    synthesise,
)
from flapgym.core.arrays import BLADES, Array
from flapgym.core.fields import Count
from flapgym.core.state_space import StateSpace, require_time_step
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind import von_karman_filter

SOLVED = 1
"""Exit flag of the solver: optimal."""
TOLERANCE = 1e-9
"""Of the solver, in fractions of the limits; the stops in sight are those exceeded by more."""


def _solver(from_offsets: Array) -> Any:
    """An active-set solver set up for the horizon; only its bounds change from step to step."""
    try:
        import daqp
    except ImportError:
        raise ImportError("predictive control needs the solver daqp: pip install 'flapgym[mpc]'") from None
    solver = daqp.Model()
    solver.settings = {"primal_tol": TOLERANCE}
    rows, blocks = from_offsets.shape
    bound = np.ones(rows)
    solver.setup(
        np.eye(blocks), np.zeros(blocks), from_offsets, bound, -bound, np.zeros(rows, dtype=np.int32)
    )
    return solver


class PredictiveController:
    """Three constrained optima, one a blade, on the estimates of the LQG's own observer.

    Flaps are known exactly and the wind moves no stop, so a plan that keeps them within their stops leaves one that
    does at the next step: braking. Where blocking or rounding leaves none all the same, the blade's flaps brake.

    Parameters
    ----------
    name : str
        What tables call it.
    model : TurbineModel
        Its clamped blade and turbulence are the design model, unless another is given.
    weights : Weights
        Of the LQG it is without stops.
    preview : int
        Samples of the coming wind it is given at each step, of the next step first. They stand behind the observation,
        in m/s; the runner gives them (`flapgym.evaluation.simulate`).
    blocks : tuple of int
        Steps for which each offset is held; their sum is the horizon.
    design : DesignModel, optional
        Of one blade behind any disturbance, as `field_design(..., multiblade=False)` has it for a field.

    Raises
    ------
    ValueError
        If the design model is of other than one blade, another number of flaps or another time step than the model, or
        if it comes with a preview: what that tells is the wind of the model's homogeneous turbulence.
    ImportError
        Without the solver.
    """

    observe: tuple[str, ...] = OBSERVED
    steps_per_action = 1
    per_blade = True

    def __init__(
        self,
        name: str,
        model: TurbineModel,
        weights: Weights,
        preview: int = 0,
        blocks: tuple[int, ...] = BLOCKS,
        design: DesignModel | None = None,
    ) -> None:
        Count(at_least=0).check(preview, f"agent {name}: preview")
        if not blocks:
            raise ValueError(f"agent {name}: blocks: expected one or more numbers of steps, got none")
        for index, steps in enumerate(blocks):
            Count(at_least=1).check(steps, f"agent {name}: blocks[{index}]")
        if design is None:
            design = design_model(model)
        else:
            given = f"agent {name}: design"
            require_flaps(given, design.channels.flaps, model)
            require_time_step(f"{given}.time_step", design.time_step, model.time_step, "the model's")
            if preview:
                raise ValueError(
                    f"agent {name}: preview: expected 0 with a design model given, of whose disturbance samples of the "
                    f"homogeneous wind do not tell, got {preview}"
                )
        self.name, self.model_hash, self.preview = name, model.hash, preview
        self.horizon = condense(design, weights, preview, blocks)
        self._solver = _solver(self.horizon.from_offsets)
        self._start = initial_estimate(design, weights)
        self._limit, self.time_step = np.array(acceleration_limits(model)), model.time_step
        self.flaps = len(model.flaps)
        self._inputs = 1 + 2 * self.flaps
        self._order = design.A.shape[0]
        self._step = self._step_matrix(model, design, weights)

    def _step_matrix(self, model: TurbineModel, design: DesignModel, weights: Weights) -> Array:
        """[estimate, measured, coming wind] times it is [next estimate, LQG's actions, rows of the horizon]."""
        h, observer, n, inputs = self.horizon, synthesise(design, weights), self._order, self._inputs
        known = np.zeros((self.preview, n + inputs + self.preview))
        if self.preview:
            wind = von_karman_filter(
                model.wind_speed,
                model.turbulence_intensity,
                model.length_scale,
                model.time_step,
                FILTER_ORDER,
            )
            output, state = innovations(wind, self.preview)
            # Innovations from the filter's estimated state, the first of the scaled states, and the wind to come.
            known[:, : wind.order] = state * design.scale[: wind.order]
            known[:, n + inputs :] = output
        flap = np.zeros((n + inputs - 1, n + inputs + self.preview))
        flap[:n, :n] = np.eye(n)
        flap[n:, n + 1 : n + inputs] = flap_units(design)
        after = np.hstack([observer.A, observer.B, np.zeros((n, self.preview))])
        if self.preview:
            after += design.G @ known[:1]
        # Minus: u = -K z; the feedforward has its sign already (`condense`).
        action = h.preview_gain @ known - h.gain @ flap
        rows = h.from_state @ flap + h.from_wind @ known
        return np.ascontiguousarray(np.vstack([after, action, rows]).T)

    @property
    def unconstrained(self) -> StateSpace:
        """The linear controller of a blade it is while no stop is in sight, without previewed wind."""
        n = self._order
        table = self._step[: n + self._inputs, : n + self.flaps].T
        channels, limit = BLADE.with_flaps(self.flaps), self._limit[:, None]
        return StateSpace(
            A=table[:n, :n],
            B=table[:n, n:],
            C=limit * table[n:, :n],
            D=limit * table[n:, n:],
            time_step=self.time_step,
            inputs=channels.inputs,
            outputs=channels.outputs,
        )

    def predict(
        self,
        observation: Floats,
        state: Array | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array | None]:
        """Action (..., 3 F) and next estimates (..., 3, n) for an observation (..., 3 + 6 F + preview)."""
        values = np.asarray(observation, dtype=float)
        signals = BLADES * blade_entries(self.observe, self.flaps)
        if values.shape[-1] != signals + self.preview:
            raise ValueError(
                f"agent {self.name}: expected {signals} observations ({', '.join(self.observe)} of three blades) and "
                f"{self.preview} samples of coming wind, got {values.shape[-1]}"
            )
        measured = by_blade(values[..., :signals], self.observe, self.flaps)
        coming = values[..., None, signals:]
        batch, n = measured.shape[:-2], self._order
        if state is None:
            state = measured @ self._start.T
        elif episode_start is not None and np.any(episode_start):
            begins = np.broadcast_to(np.asarray(episode_start, dtype=bool).reshape(-1), batch or (1,))
            state = np.where(begins.reshape(*batch, 1, 1), measured @ self._start.T, state)
        coming = np.broadcast_to(coming, (*batch, BLADES, self.preview))
        after = np.concatenate([state, measured, coming], axis=-1) @ self._step
        action, rows = after[..., n : n + self.flaps], after[..., n + self.flaps :]
        beyond = (np.abs(rows) > 1.0 + TOLERANCE).any(axis=-1)
        for index in np.argwhere(beyond):
            place = tuple(index)
            action[place] = self.within(action[place], rows[place], measured[place][1 + self.flaps :])
        action = action.reshape(*batch, BLADES * self.flaps)
        return np.clip(action, -1.0, 1.0).astype(np.float32), after[..., :n]

    def within(self, action: Array, rows: Array, rate: Array) -> Array:
        """The optimal actions (F,) of a blade with a stop in sight."""
        self._solver.update(bupper=1.0 - rows, blower=-1.0 - rows)
        offsets, _, flag, _ = self._solver.solve()
        if flag != SOLVED:
            # Nothing is feasible, which the flaps' own motion never brings about: brake.
            return np.clip(-rate / (self._limit * self.time_step), -1.0, 1.0)
        return np.asarray(action + self.horizon.first_offset @ offsets[: self.flaps])
