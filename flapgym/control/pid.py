"""PD with a leaky integral of the moment, and the same on multi-blade components as individual pitch control has it.

The integral leaks because an integrator of the moment would ask a flap between stops for what only the trim can give.
Without an integral this is the PD controller of `flapgym.control.pd`, state for state but one that does nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from flapgym.control.blade_controller import BladeController
from flapgym.control.channels import MULTIBLADE
from flapgym.control.pd import PD_START, PDGains, pd_controller
from flapgym.control.rotor_controller import RotorController
from flapgym.core.arrays import Array
from flapgym.core.fields import Quantity
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import TurbineModel

PID_START = np.vstack([PD_START, np.zeros((1, 3))])
"""First state per unit of the first inputs: no slope, and nothing integrated yet."""


@dataclass(frozen=True)
class PIDGains(PDGains):
    """Those of the PD, and an integral: the demand is proportional (M + slope's part + integral_gain times it).

    Attributes
    ----------
    integral_gain : float
        What the leaky integral comes to for a steady moment, beside the moment's own one; zero makes it the PD.
    leak_time : float
        Time in which the integral forgets [s]; for faster moments it is an integral of integral_gain / leak_time.
    """

    integral_gain: float
    leak_time: float

    def __post_init__(self) -> None:
        super().__post_init__()
        Quantity("number", at_least=0.0).check(self.integral_gain, "pid.integral_gain")
        Quantity("time", above=0.0).check(self.leak_time, "pid.leak_time")


def pid_agent(name: str, model: TurbineModel, gains: PIDGains) -> BladeController:
    """Three copies of the PID controller at the step of `model`, under the name given."""
    system = pid_controller(gains, model.time_step)
    return BladeController(name, system, PID_START, model.acceleration_limit, model.hash)


def pid_controller(gains: PIDGains, time_step: float) -> StateSpace:
    """States [low-passed moment, leaky integral of the moment]; inputs and output as of `pd_controller`."""
    pd = pd_controller(gains, time_step)
    keep = np.exp(-time_step / gains.leak_time)
    drive = np.array([[1.0 - keep, 0.0, 0.0]])
    integral = -(gains.servo_frequency**2) * gains.proportional * gains.integral_gain
    return StateSpace(
        A=block_diag(pd.A, keep),
        B=np.vstack([pd.B, drive]),
        C=np.hstack([pd.C, [[integral]]]),
        D=pd.D,
        time_step=time_step,
        inputs=pd.inputs,
        outputs=pd.outputs,
    )


def multiblade_pid_agent(
    name: str, model: TurbineModel, collective: PIDGains, cyclic: PIDGains
) -> RotorController:
    """Individual flap control: collective, tilt and yaw channels as the wind industry has for individual pitch.

    The moments of the blades are turned into components of the fixed frame by the azimuth, each channel has a PID of
    its own, and the demands are turned back. Tilt and yaw share their gains, so the law knows no preferred azimuth.
    The servo acts blade by blade on flap motions read after the stops. In the linear turbine nothing stands at
    multiples of the blade passing frequency, so there is no notch; the slope's low-pass is the only filter.
    """
    channels = [pid_controller(gains, model.time_step) for gains in (collective, cyclic, cyclic)]
    system = StateSpace(
        A=block_diag(*(each.A for each in channels)),
        B=_by_signal([each.B for each in channels]),
        C=block_diag(*(each.C for each in channels)),
        D=_by_signal([each.D for each in channels]),
        time_step=model.time_step,
        inputs=MULTIBLADE.inputs,
        outputs=MULTIBLADE.outputs,
    )
    return RotorController(name, system, _by_signal([PID_START] * 3), model.acceleration_limit, model.hash)


def _by_signal(parts: list[Array]) -> Array:
    """Block diagonal with the columns signal by signal: the moments of all channels, then angles, then rates."""
    joined = block_diag(*parts)
    signals = parts[0].shape[1]
    order = [channel * signals + signal for signal in range(signals) for channel in range(len(parts))]
    return np.asarray(joined[:, order])
