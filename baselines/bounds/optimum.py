"""The motion of all flaps, and of pitch, that makes a metric least: a smooth programme with bounds, solved by L-BFGS-B.

A flap's angle is a quadratic spline, its acceleration constant between knots: the curve lies within the hull of the
spline's coefficients, so that the angle's stops are bounds of the variables. Whatever else has stops is linear in them
and is kept by an augmented Lagrangian (Nocedal and Wright, Numerical Optimization, 2006, section 17.4). The whole
motion is shrunk by the little that is left over: rest is within all stops, and so is all that lies between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, minimize

from baselines.bounds.chain import solve_chain
from baselines.bounds.metrics import Metric
from baselines.bounds.modes import march
from baselines.bounds.response import QUANTITIES, Actuator, Response
from flapgym.core.arrays import BLADES, Array
from flapgym.plant.actuator import free_motion

REACH = 1.0 - 1e-5
"""Share of the stops that a plan uses: the plant would stop a flap that touches its angle's while it still turns."""
PRICES = (0.1, 1.0, 1.0)
"""Of the mean square of what is beyond a stop, in shares of it, round by round."""
ITERATIONS = 45
"""Of L-BFGS-B in a round."""
MEMORY = 20
"""Of L-BFGS-B: pairs kept."""


@dataclass(frozen=True, eq=False)
class Point:
    """Where a search stands.

    Attributes
    ----------
    variables : (K, B, A) float
        Of a `Programme`.
    multipliers : (K, 3, B, A) float
        Of the stops of command, angle and rate, signed, over the price.
    """

    variables: Array
    multipliers: Array


@dataclass(frozen=True, eq=False)
class Programme:
    """Minimise a metric of free + response(motion) over variables (K, B, A) within +-1.

    A flap's variables are coefficients of its spline over the angle's stop, pitch's the angle demanded over its stop.

    Attributes
    ----------
    response : Response
    free : (T, 3) float
        Moments with actuators at rest [N m].
    """

    response: Response
    free: Array

    @property
    def limits(self) -> Array:
        """Of command, angle and rate (3, 1, A)."""
        return np.stack([each.limits for each in self.response.actuators], axis=-1)[:, None]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Of the variables."""
        return self.response.intervals, BLADES, len(self.response.actuators)

    def motion(self, x: Array) -> Array:
        """Command, angle and rate at the intervals' starts (K, 3, B, A) of variables (K, B, A)."""
        return np.stack(
            [
                self._spline(x[..., index], each) if each.integrates else _following(x[..., index], each)
                for index, each in enumerate(self.response.actuators)
            ],
            axis=-1,
        )

    def motion_pull(self, pull: Array) -> Array:
        """Adjoint of `motion`."""
        return np.stack(
            [
                self._spline_pull(pull[..., index], each)
                if each.integrates
                else _following_pull(pull[..., index], each)
                for index, each in enumerate(self.response.actuators)
            ],
            axis=-1,
        )

    def total(self, motion: Array) -> Array:
        """Moments (T, 3) of a motion (K, 3, B, A) [N m]."""
        return np.asarray(self.free + self.response.moments(motion)[: len(self.free)])

    def pull(self, slope: Array) -> Array:
        """Slope by command, angle and rate (K, 3, B, A) of a metric whose slope by the moments is (T, 3)."""
        return self.response.pull(padded(slope, self.response))

    def solve(
        self,
        metric: Metric,
        start: Point | None = None,
        prices: Sequence[float] = PRICES,
        iterations: int = ITERATIONS,
    ) -> Point:
        """The least of a metric that is found from a start, by default rest; of a convex metric the least there is.

        It may be beyond the stops by what the last round leaves: see `plan`.
        """
        point, limits = start or self.rest, self.limits
        for price in prices:
            weight = price / self.shape[0]

            def of(
                flat: Array, weight: float = weight, held: Array = point.multipliers
            ) -> tuple[float, Array]:
                motion = self.motion(flat.reshape(self.shape))
                value, slope = metric(self.total(motion))
                beyond = _beyond(motion / limits + held)
                pull = self.pull(slope) + weight * beyond / limits
                value += 0.5 * weight * float(np.sum(beyond**2))
                return value, self.motion_pull(pull).ravel()

            found = minimize(
                of,
                point.variables.ravel(),
                jac=True,
                method="L-BFGS-B",
                bounds=Bounds(-1.0, 1.0),
                # It ends by the count: how near it came is told by the certificate.
                options={"maxiter": iterations, "maxcor": MEMORY, "ftol": 0.0, "gtol": 0.0},
            )
            x = found.x.reshape(self.shape)
            # Signed: of the two stops of a quantity at most one is met.
            point = Point(x, _beyond(self.motion(x) / limits + point.multipliers))
        return point

    @property
    def rest(self) -> Point:
        """Where all is at rest."""
        count, *each = self.shape
        return Point(np.zeros(self.shape), np.zeros((count, QUANTITIES, *each)))

    def _spline(self, x: Array, flap: Actuator) -> Array:
        """Command, angle and rate (K, 3, B) of coefficients (K, B); those of the time at rest before are zero."""
        h = self.response.parameters.sizes.steps * self.response.parameters.time_step
        c = flap.limits[1] * np.concatenate([np.zeros((2, x.shape[1])), x])
        first, second, third = c[:-2], c[1:-1], c[2:]
        return np.stack(
            [(third - 2.0 * second + first) / h**2, 0.5 * (first + second), (second - first) / h], axis=1
        )

    def _spline_pull(self, pull: Array, flap: Actuator) -> Array:
        h = self.response.parameters.sizes.steps * self.response.parameters.time_step
        command, angle, rate = np.moveaxis(pull, 1, 0)
        c = np.zeros((len(pull) + 2, pull.shape[-1]))
        c[2:] += command / h**2
        c[1:-1] += -2.0 * command / h**2 + 0.5 * angle + rate / h
        c[:-2] += command / h**2 + 0.5 * angle - rate / h
        return np.asarray(flap.limits[1] * c[2:])


def _following(x: Array, pitch: Actuator) -> Array:
    """Command, angle and rate (K, 3, B) of an actuator that follows demands (K, B) in shares of its stop."""
    command = pitch.limits[0] * x
    values, vectors = np.linalg.eig(pitch.march.astype(complex))
    drive = np.linalg.solve(vectors, pitch.drive)
    read = np.hstack([vectors.real, -vectors.imag]).T
    blades = [_marched(values, np.outer(each, drive)) @ read for each in command.T]
    return np.concatenate([command[:, None], np.stack(blades, axis=-1)], axis=1)


def _following_pull(pull: Array, pitch: Actuator) -> Array:
    values, vectors = np.linalg.eig(pitch.march.T.astype(complex))
    into = np.linalg.inv(vectors).T
    read = np.hstack([vectors.real, -vectors.imag]).T
    found = pull[:, 0].copy()
    for blade in range(pull.shape[-1]):
        found[:, blade] += (_marched(values, pull[::-1, 1:, blade] @ into)[::-1] @ read) @ pitch.drive
    return np.asarray(pitch.limits[0] * found)


def _marched(values: Array, pushes: Array) -> Array:
    """`march` of complex pushes (K, M)."""
    return march(values.real.copy(), values.imag.copy(), np.hstack([pushes.real, pushes.imag]))


def within(motion: Array, actuator: Actuator, interval: float) -> Array:
    """The motion (K, 3) within all stops whose angles are nearest to those of another, squares summed."""
    # One interval more than there is: what the last command leads to has to be within the stops as well.
    wanted = np.vstack([motion, np.zeros_like(motion[:1])]) / actuator.limits
    weight = np.zeros_like(wanted)
    weight[:-1, 1] = 1.0
    # A flap's curve lies in the hull of its spline's coefficients, and angle + rate h / 2 are those.
    hull = 0.5 * interval if actuator.integrates else 0.0
    found, _ = solve_chain(actuator, -weight * wanted, weight, hull, REACH)
    return found[:-1] * actuator.limits


def _beyond(shares: Array) -> Array:
    """By how much shares of stops are beyond +-REACH, signed."""
    return np.asarray(np.sign(shares) * np.maximum(np.abs(shares) - REACH, 0.0))


def padded(weights: Array, response: Response) -> Array:
    """Weights (T, 3) with zeros behind, as many as whole intervals have samples."""
    found = np.zeros((response.intervals * response.parameters.sizes.steps, weights.shape[1]))
    found[: len(weights)] = weights
    return found


@dataclass(frozen=True, eq=False)
class Plan:
    """A motion as actions of the environment, each held over an interval.

    Attributes
    ----------
    actions : (K, B F) or (K, B F + B) float32
        As the environment takes them: accelerations of the flaps, then pitch demanded.
    motion : (K, 3, B, A) float
        Command, angle and rate at the intervals' starts, of those very actions.
    """

    actions: Array
    motion: Array


def plan(programme: Programme, x: Array) -> Plan:
    """What variables stand for, brought within all stops at every sample, in the numbers that actions can have."""
    actuators, p = programme.response.actuators, programme.response.parameters
    steps = p.sizes.steps
    wanted = programme.motion(x)
    for index, each in enumerate(actuators):
        for blade in range(BLADES):
            wanted[:, :, blade, index] = within(wanted[:, :, blade, index], each, steps * p.time_step)
        between = free_motion(steps, p.time_step, each.law, False).reshape(steps + 1, 2, QUANTITIES)
        swing = np.einsum("sqm,kmb->kqsb", between, wanted[..., index])
        worst = max(
            np.abs(wanted[:, 0, :, index]).max() / each.limits[0],
            *(np.abs(swing[:, which]).max() / each.limits[1 + which] for which in range(2)),
        )
        # What a solver leaves, and rounding takes back below.
        wanted[..., index] *= min(1.0, REACH / max(worst, 1e-300))
    return _rounded(programme.response, wanted)


def _rounded(response: Response, wanted: Array) -> Plan:
    """The motion that float32 actions make; a flap, which would drift for ever, is brought back at the next one."""
    p, actuators = response.parameters, response.actuators
    h, motion = p.sizes.steps * p.time_step, np.zeros_like(wanted)
    actions = np.zeros((len(wanted), BLADES, len(actuators)), dtype=np.float32)
    for index, each in enumerate(actuators):
        state = np.zeros((2, BLADES))
        for k, (command, angle, rate) in enumerate(wanted[..., index]):
            if each.integrates:
                # Deadbeat in two intervals for what rounding has left.
                command = command - (state[0] - angle) / h**2 - 1.5 * (state[1] - rate) / h
            actions[k, :, index] = np.clip(command / each.limits[0], -1.0, 1.0)
            held = actions[k, :, index].astype(float) * each.limits[0]
            motion[k, :, :, index] = held, *state
            state = each.march @ state + each.drive[:, None] * held
    flaps = actions[..., : p.sizes.flaps].reshape(len(actions), -1)
    return Plan(
        np.concatenate([flaps, actions[..., p.sizes.flaps :].reshape(len(actions), -1)], axis=1), motion
    )
