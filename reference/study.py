"""The coupled turbine with further loads to look at: edgewise root moments and the tower's base, for studies only."""

from __future__ import annotations

from dataclasses import replace

from flapgym.aeroelastic.build import build_model
from flapgym.core.state_space import StateSpace
from flapgym.turbine import Case, Signals

STUDY_OUTPUTS = ("rbm_edge_0", "rbm_edge_c", "rbm_edge_s", "tower_base_fore_aft", "tower_base_side_side")


def study_turbine(case: Case) -> StateSpace:
    """The turbine of a case's model with ``STUDY_OUTPUTS`` after its own outputs; takes as long as a build.

    Where the case's loads leave out the mean circulation in the perturbed flow, in-plane air loads come out some 40 %
    too small, and with them the edgewise moments' share from the air.
    """
    signals = Signals(outputs=("rbm_edge", "tower_base_fore_aft", "tower_base_side_side"))
    return build_model(replace(case, signals=signals)).turbine
