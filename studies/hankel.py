"""Figure 12: Hankel singular values of the rotor's aerodynamics, whose cyclic components are reduced one by one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from flapgym.aeroelastic.blade_lattice import reduce_component
from flapgym.core.arrays import Array
from studies.parts import Study

TOTALS = (20, 50, 150)
"""States of the paper's Figure 14; a third to each cyclic component."""


def reduced_states(total: int) -> int:
    """States of each cyclic component: the whirl component stands for two of three."""
    return round(total / 3)


def rotor_values(collective: ArrayLike, whirl: ArrayLike) -> Array:
    """Hankel singular values of the whole rotor, largest first, from those of its components."""
    return np.sort(np.concatenate([collective, whirl, whirl]))[::-1]


def hankel_values(study: Study) -> Array:
    """Those of a case, its inputs and outputs scaled as its reduction scales them."""
    order = study.case.reduction.aerodynamic_states
    components = (reduce_component(study.rotor, study.parts.lattice, m, order) for m in (0, 1))
    return rotor_values(*(component.hankel_singular_values for component in components))
