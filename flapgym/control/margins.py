"""How much a loop bears that its design did not know: delay, and gain and phase of all three blades at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flapgym.control.channels import controller_channels
from flapgym.control.closed_loop import closed_loop
from flapgym.control.growth import growth
from flapgym.control.peak_gain import peak_gain
from flapgym.core.fields import Count
from flapgym.core.state_space import StateSpace
from flapgym.model.turbine_model import TurbineModel


@dataclass(frozen=True)
class DiskMargin:
    """The symmetric disk margin alpha, and the gain and phase it guarantees.

    Attributes
    ----------
    alpha : float
        1 / max |S - 1/2|, 0 to 2: the loop stays stable while each blade's measurement is multiplied by
        (1 + d/2) / (1 - d/2) with any complex |d| < alpha, the blades' d being alike or not. 0 for an unstable loop.
    frequency : float
        Where the margin is least, or of what grows [Hz].

    Notes
    -----
    The maximum is that of the largest singular value, so the margin covers more than three factors: every complex 3 x 3
    matrix d of norm below alpha, which mixes the blades' measurements, constant or varying in time. For three factors,
    one a blade and independent, it is a lower bound of what is borne. With blades alike no constant scaling of their
    signals against each other raises it: the blades can be exchanged, and the mean over the exchanges scales nothing.
    """

    alpha: float
    frequency: float

    @property
    def gain(self) -> tuple[float, float]:
        """Least and largest gain at no change of phase; from two on there is no bound."""
        half = 0.5 * self.alpha
        return (1.0 - half) / (1.0 + half), (1.0 + half) / (1.0 - half) if half < 1.0 else np.inf

    @property
    def phase(self) -> float:
        """Change of phase borne at no change of gain [rad]."""
        return float(2.0 * np.arctan(0.5 * self.alpha))


def disk_margin(model: TurbineModel, controller: StateSpace, plant: StateSpace | None = None) -> DiskMargin:
    """Disk margin at the three measured moments together, from the largest singular value of S - T (Seiler 2020).

    The least margin over all frequencies is at most `peak_gain.TOLERANCE` smaller than the one returned, relative.
    Multi-blade components are scaled to a rotation of the blades' own signals, which keeps every norm: so the factors
    are those on the blades' own measurements, though constant ones that differ from blade to blade are periodic in the
    frame of the tower.
    """
    loop = closed_loop(model, controller, plant=plant)
    grows = growth(loop)
    if grows is not None:
        return DiskMargin(0.0, grows.frequency)
    peak, frequency = peak_gain(sensitivity_difference(loop))
    return DiskMargin(2.0 / peak, frequency)


def sensitivity_difference(loop: StateSpace) -> StateSpace:
    """S - T of a closed loop at the three measured moments, components scaled to a rotation of the blades' own."""
    channels = controller_channels(loop.outputs)
    moment = loop.select(inputs=channels.named("noise"), outputs=channels.moments)
    scale = np.sqrt(channels.weight)
    # Noise n on the measurement: the loop sees S n, of which the true moment is S n - n = -T n.
    return replace(
        moment,
        B=moment.B / scale,
        C=2.0 * scale[:, None] * moment.C,
        D=2.0 * scale[:, None] * moment.D / scale + np.eye(channels.count),
    )


def late_measurement(controller: StateSpace, steps: int, rotor_speed: float) -> StateSpace:
    """The controller whose moments arrive so many steps late, its flaps' own motion in time.

    In multi-blade coordinates what arrives late is turned on, as a controller that knows its delay does.
    """
    Count(at_least=0).check(steps, "late_measurement.steps")
    channels = controller_channels(controller.inputs)
    m, p = channels.count, channels.actions
    turn = channels.turn(rotor_speed * controller.time_step)
    for _ in range(steps):
        n = controller.order
        rbm, flap = controller.B[:, :m], controller.B[:, m:]
        controller = StateSpace(
            A=np.block([[controller.A, rbm], [np.zeros((m, n + m))]]),
            # The axes turn on while a measurement waits; flap motion is read in time and passes by.
            B=np.block([[np.zeros((n, m)), flap], [turn, np.zeros((m, 2 * p))]]),
            C=np.hstack([controller.C, controller.D[:, :m]]),
            D=np.hstack([np.zeros((p, m)), controller.D[:, m:]]),
            time_step=controller.time_step,
            inputs=controller.inputs,
            outputs=controller.outputs,
        )
    return controller


def delay_margin(model: TurbineModel, controller: StateSpace, longest: int = 60) -> int:
    """Largest delay of the measurement, in steps, up to which the full closed loop is stable; at most `longest`.

    Every delay is tried in turn: beyond an unstable one a loop may be stable again. 0, too, for a loop that is unstable
    without delay.
    """
    Count(at_least=1).check(longest, "delay_margin.longest")
    for delay in range(longest + 1):
        late = late_measurement(controller, delay, model.rotor_speed)
        if closed_loop(model, late).spectral_radius() >= 1.0:
            return max(delay - 1, 0)
    return longest
