"""Metrics, damage-equivalent loads and the paired comparison of agents on the same wind (paper section IV.C)."""

from flapgym.evaluation.bands import Bands, bands
from flapgym.evaluation.bootstrap import Estimate, paired_change, summed_damage_change
from flapgym.evaluation.channels import ChannelLoads, ChannelScore, SlopeScore, Split, channel_loads, split
from flapgym.evaluation.compare import compare
from flapgym.evaluation.comparison import SCORED_SEED, Comparison, Plan, Score, plan, run
from flapgym.evaluation.metrics import (
    Metrics,
    damage_equivalent_load,
    damage_equivalent_loads,
    measure,
    root_mean_square,
    summed_damage_load,
)
from flapgym.evaluation.published import Bound
from flapgym.evaluation.record import Record
from flapgym.evaluation.report import as_json, as_markdown, as_text, writable_folder, write_report
from flapgym.evaluation.series import as_dataset, write_series
from flapgym.evaluation.simulate import simulate, simulate_together, steady_loads

__all__ = [
    "SCORED_SEED",
    "Bands",
    "Bound",
    "ChannelLoads",
    "ChannelScore",
    "Comparison",
    "Estimate",
    "Metrics",
    "Plan",
    "Record",
    "Score",
    "SlopeScore",
    "Split",
    "as_dataset",
    "as_json",
    "as_markdown",
    "as_text",
    "bands",
    "channel_loads",
    "compare",
    "damage_equivalent_load",
    "damage_equivalent_loads",
    "measure",
    "paired_change",
    "plan",
    "root_mean_square",
    "run",
    "simulate",
    "simulate_together",
    "split",
    "steady_loads",
    "summed_damage_change",
    "summed_damage_load",
    "writable_folder",
    "write_report",
    "write_series",
]
