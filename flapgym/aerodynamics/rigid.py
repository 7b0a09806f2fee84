"""The rigid, undeflected rotor of a case: its mean state and its answer to gust and flaps alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flapgym.aerodynamics.downwash import flap_downwash, gust_downwash
from flapgym.aerodynamics.linearisation import (
    MeanFlow,
    SegmentMotion,
    cambered,
    full_loads,
    gust_past_segments,
)
from flapgym.aerodynamics.loads import FullLoads
from flapgym.aerodynamics.model import Aerodynamics
from flapgym.aerodynamics.response import collective_response, steady_response, transfer_function
from flapgym.aerodynamics.rotor import build_aerodynamics, build_mean_aerodynamics, mean_is_perturbations
from flapgym.aerodynamics.steady import MeanLoads, mean_loads, momentum_induction
from flapgym.core.arrays import Array
from flapgym.turbine import Case

SETTLED = 1e-8
"""Change of the induction between two rounds that counts as none."""

MAX_ITERATIONS = 50
"""Rounds of induction and thrust; each gains about a digit."""


@dataclass(frozen=True, eq=False)
class RigidRotor:
    """A case's rotor of straight blades, or one such blade alone, about its mean state.

    Attributes
    ----------
    aero : Aerodynamics
        The perturbations' lattice.
    flow : MeanFlow
        The mean state, with the wake the case asks for behind it.
    downwash : (n, 1 + F) float
        Per m/s of homogeneous gust and per radian of each of the case's F flaps [m/s].
    motion : SegmentMotion or None
        How these move the air past the bound segments, where the case's loads take that in.
    """

    aero: Aerodynamics
    flow: MeanFlow
    downwash: Array
    motion: SegmentMotion | None

    @property
    def loads(self) -> MeanLoads:
        """Mean loads."""
        return self.flow.loads

    def full(self, load: Array) -> FullLoads | None:
        """What the mean circulation adds to loads (ny, 3 P)."""
        return None if self.motion is None else full_loads(self.aero, self.flow, self.motion, load)

    def steady(self, load: Array) -> Array:
        """Steady loads (ny, 1 + F) per m/s of gust and per radian of each flap."""
        return steady_response(self.aero, self.downwash, load, self.full(load))

    def step(self, duration: float, load: Array) -> Array:
        """Loads (T, ny) in time after a step of one m/s, the flaps at rest; duration [s]."""
        signal = np.zeros((round(duration / self.aero.time_step), self.downwash.shape[1]))
        signal[:, 0] = 1.0
        return collective_response(self.aero, signal, self.downwash, load, self.full(load))

    def response(self, component: int, z: ArrayLike, load: Array) -> NDArray[np.complex128]:
        """Loads (nz, ny, 1 + F) of a cyclic component in the z-domain."""
        return transfer_function(self.aero, component, z, self.downwash, load, self.full(load))


def rigid_rotor(case: Case, blades: int = 3) -> RigidRotor:
    """The rigid rotor of a case, or with one blade that blade turning alone."""
    aero = build_aerodynamics(case, blades)
    flow = _rigid_flow(case, aero, blades)
    full = case.airloads.linearisation == "full"
    seen = cambered(aero, flow.loads.zero_lift_angle) if full else aero
    turned = [flap_downwash(seen, flap)[0] for flap in case.flaps]
    downwash = np.column_stack([gust_downwash(seen).sum(axis=1), *turned])
    motion = None
    if full:
        gust = gust_past_segments(aero).sum(axis=2, keepdims=True)
        # A flap is felt in the downwash alone.
        velocity = np.concatenate([gust, np.zeros((*gust.shape[:2], len(turned)))], axis=2)
        motion = SegmentMotion(velocity, np.zeros_like(velocity))
    return RigidRotor(aero, flow, downwash, motion)


def _rigid_flow(case: Case, aero: Aerodynamics, blades: int) -> MeanFlow:
    chosen = case.airloads.mean_induction
    if case.airloads.mean_wake == "perturbations":
        same = aero if mean_is_perturbations(case) else build_mean_aerodynamics(case, 0.0, blades)
        return MeanFlow(same, mean_loads(case, same))
    induction = 0.0 if chosen == "momentum" else chosen
    for _ in range(MAX_ITERATIONS):
        mean = build_mean_aerodynamics(case, induction, blades)
        loads = mean_loads(case, mean)
        before = induction
        if chosen == "momentum":
            induction = momentum_induction(loads.thrust_coefficient)
        if abs(induction - before) < SETTLED:
            return MeanFlow(mean, loads)
    raise ValueError(
        f"airloads.mean_induction: thrust and induction do not settle within {MAX_ITERATIONS} rounds; give a factor"
    )
