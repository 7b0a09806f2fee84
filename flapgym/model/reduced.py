"""The turbine model reduced once more as a whole, to an accuracy rather than to an order.

For those who want a smaller plant than the shipped one: half the states cost a thousandth of the loads.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg

from flapgym.core.fields import Quantity
from flapgym.core.state_space import StateSpace
from flapgym.model.signals import COMPONENTS, blade_flap_inputs, blade_inputs, turbine_inputs
from flapgym.model.turbine_model import TurbineModel
from flapgym.reduction import balance, relative_error
from flapgym.wind import von_karman_filter

# The flaps as a controller moves them: half their travel in rms, up to about the first flapwise frequencies.
_FLAP_BANDWIDTH = 1.0  # Hz
_FLAP_SHARE = 0.5  # of the angle limit


def reduced_model(model: TurbineModel, tolerance: float) -> TurbineModel:
    """A model of few states whose outputs stay within a tolerance of the full one's.

    Parameters
    ----------
    model : TurbineModel
    tolerance : float
        Largest rms error of any output over that output's rms, under the reference turbulence together with
        flaps that move independently (1 Hz bandwidth, half the angle limit in rms); 0 < tolerance < 1.

    Returns
    -------
    TurbineModel
        With a smaller ``turbine``; all else as it was. Above some 5 Hz, where neither turbulence nor flaps
        excite it, the error is not controlled.

    Raises
    ------
    ValueError
        If the tolerance is out of range, or the model has winds by strip, pitch or gravity as inputs.
    """
    turbine, error = smallest(model.turbine, activity(model), tolerance)
    errors = {**model.record.errors, "turbine reduced as a whole": error}
    return replace(model, turbine=turbine, record=replace(model.record, errors=errors))


def reduced_blade(model: TurbineModel, tolerance: float) -> StateSpace:
    """The clamped blade in few states, its outputs within a tolerance as those of `reduced_model`.

    The wind and its own flap are weighed as they come, in which a balanced truncation by itself errs: it takes a radian
    of flap for as likely as a metre per second of wind, and a metre of the tip for as much as a newton metre.
    """
    own = activity(model)
    # A flap of the blade that stands at azimuth zero is the sum of its mean and its cosine component.
    inputs = blade_inputs(len(model.flaps))
    first = np.zeros((len(inputs), len(own.outputs)))
    for row, name in enumerate(blade_flap_inputs(len(model.flaps))):
        first[row, [own.outputs.index(f"{name}_0"), own.outputs.index(f"{name}_c")]] = 1.0
    first[-1, own.outputs.index("wind")] = 1.0
    weight = replace(own, C=first @ own.C, D=first @ own.D, outputs=inputs)
    return smallest(model.blade, weight, tolerance)[0]


def smallest(system: StateSpace, weight: StateSpace, tolerance: float) -> tuple[StateSpace, float]:
    """A system of few states within a tolerance of the full one under what drives it, and its error.

    Raises
    ------
    ValueError
        If the tolerance is out of range.
    """
    Quantity("number", above=0.0, below=1.0).check(tolerance, "reduced_model.tolerance")
    balanced = balance(system, weight)
    # The error falls with the order but not strictly, so bisection finds a small order, near the least.
    low, high, best, least = 0, system.order, system, 0.0
    while high - low > 1:
        middle = (low + high) // 2
        reduced = balanced.truncated(middle)
        error = float(relative_error(system, reduced, weight).max())
        if error <= tolerance:
            high, best, least = middle, reduced, error
        else:
            low = middle
    return best, least


def activity(model: TurbineModel) -> StateSpace:
    """White noise shaped into what the turbine's inputs see: turbulence and all flaps, each moving by itself.

    On the blades a flap's angle and rate are a Butterworth filter's states; in multi-blade coordinates those of the
    cosine and sine components also turn back with the rotor.
    """
    if model.strips:
        raise ValueError(
            "reduced_model: expected a homogeneous wind, got one by strip, which is weighed by no spectrum here; "
            "take the model as it is, or one without strip winds"
        )
    if further := model.turbine.inputs[len(turbine_inputs(len(model.flaps))) :]:
        raise ValueError(
            f"reduced_model: expected flaps and wind as inputs, got {further[0]}, which no spectrum weighs here; take "
            "the model as it is, or one without pitch and gravity"
        )
    wind = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step
    )
    cutoff = 2.0 * np.pi * _FLAP_BANDWIDTH
    continuous = np.array([[0.0, 1.0], [-(cutoff**2), -np.sqrt(2.0) * cutoff]])
    step = scipy.linalg.expm(continuous * model.time_step)
    turn = model.rotor_speed * model.time_step
    back = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    # The mean of three independent signals has a third of their variance, cosine and sine components two thirds.
    mean, whirl = np.sqrt(1.0 / 3.0), np.sqrt(2.0 / 3.0)
    A, B = [wind.A], [wind.B]
    for flap in model.flaps:
        covariance = (_FLAP_SHARE * flap.angle_limit) ** 2 * np.diag([1.0, cutoff**2])
        noise = np.linalg.cholesky(covariance - step @ covariance @ step.T)
        A += [step, np.kron(back, step)]
        B += [mean * noise, whirl * noise, whirl * noise]
    dynamics, entering = scipy.linalg.block_diag(*A), scipy.linalg.block_diag(*B)
    inputs = model.turbine.inputs
    C, D = np.zeros((len(inputs), len(dynamics))), np.zeros((len(inputs), entering.shape[1]))
    # Angle and rate of each multi-blade component, flap by flap.
    rows = [
        inputs.index(f"{flap.name}_{kind}_{part}")
        for flap in model.flaps
        for part in COMPONENTS
        for kind in ("angle", "rate")
    ]
    C[rows, wind.order :] = np.eye(len(rows))
    C[inputs.index("wind"), : wind.order], D[inputs.index("wind"), : len(wind.inputs)] = wind.C[0], wind.D[0]
    white = tuple(f"white_{i}" for i in range(entering.shape[1]))
    return StateSpace(dynamics, entering, C, D, model.time_step, white, inputs)
