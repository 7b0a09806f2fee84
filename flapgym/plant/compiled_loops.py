"""What the compiled code for one turbine and for many share: how it is compiled, and how an interval is closed.

Loops that a vector unit shall take run over few slices at constant strides: only then does the compiler see that
nothing overlaps. Indices into whole arrays, strides it does not know, or a slice for every quantity cost a factor of
two to four.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic

from flapgym.plant.layout import (
    AZIMUTH,
    BLADE_COUNT,
    COUNT,
    ENTRY,
    HEAD,
    INTERVALS,
    MEAN_SQUARE,
    NOISY,
    OBSERVED,
    OWN,
    OWN_AZIMUTH,
    OWN_ELAPSED,
    REWARD,
    REWARD_ANGLE,
    REWARD_RBM,
    REWARD_TOWER,
    STEPS,
    TURN,
    WEIGHT_RBM,
    WEIGHT_TOWER,
)

OPTIONS: dict[str, Any] = {
    # Sums may be reordered and products fused; NaN and infinity keep their meaning.
    "fastmath": {"reassoc", "contract", "nsz"},
    "error_model": "numpy",
}

C1, S1 = math.cos(2.0 * math.pi / 3.0), math.sin(2.0 * math.pi / 3.0)
"""From one blade to the next."""
THIRD = 1.0 / 3.0


@intrinsic
def widest_vectors(typingctx):  # type: ignore[no-untyped-def]
    """Let LLVM use the widest vectors the processor has in the function that calls this; by itself it takes half."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # A string attribute of LLVM, which llvmlite's own list of attributes does not know.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.void(), generate


@njit(**OPTIONS)
def close(t, fore_aft, state, own, observation, row):  # type: ignore[no-untyped-def]
    """Reward, clock and observation of turbine t, whose row holds sums of squares; returns its status."""
    k, blades, elapsed = int(state[STEPS]), int(state[BLADE_COUNT]), int(own[OWN_ELAPSED])
    total = 0.0
    for b in range(3):
        row[MEAN_SQUARE + b] /= k
        total += row[MEAN_SQUARE + b]
    row[REWARD_RBM] = -state[WEIGHT_RBM] * total / blades
    row[REWARD_TOWER] = -state[WEIGHT_TOWER] * fore_aft / k
    row[REWARD] = row[REWARD_RBM] + row[REWARD_ANGLE] + row[REWARD_TOWER]
    own[OWN_ELAPSED] += 1.0
    turn = 2.0 * math.pi
    azimuth = own[OWN_AZIMUTH] + state[TURN] * k * own[OWN_ELAPSED]
    row[AZIMUTH] = min(max(azimuth - turn * math.floor(azimuth / turn), 0.0), turn)
    # Past the end of an episode there is no more noise.
    _observe(t, min(elapsed + 1, int(state[INTERVALS])), state, row, observation)
    status = 0 if abs(row[REWARD]) < math.inf else 1
    return status | (2 if elapsed + 1 >= state[INTERVALS] else 0)


@njit(**OPTIONS)
def _observe(t, sample, state, row, observation):  # type: ignore[no-untyped-def]
    """The observation of a row, rounded before it is bounded: a stop rounded up would leave the space."""
    observed = int(state[OBSERVED])
    noise = HEAD + ENTRY * observed + OWN * int(state[COUNT])
    noise += 3 * (t * (int(state[INTERVALS]) + 1) + sample)
    for i in range(observed):
        entry = state[HEAD + ENTRY * i : HEAD + ENTRY * (i + 1)]
        value = row[int(entry[0])]
        if state[NOISY] != 0.0 and entry[3] >= 0.0:
            value += state[noise + int(entry[3])]
        bound = np.float32(entry[2])
        observation[t * observed + i] = min(max(np.float32(value * entry[1]), -bound), bound)
