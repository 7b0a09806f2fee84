"""Metrics, damage-equivalent loads and the paired comparison of agents on the same wind (paper section IV.C)."""

from flapgym.evaluation.bands import Bands, bands
from flapgym.evaluation.bootstrap import Estimate, paired_change, summed_damage_change
from flapgym.evaluation.channels import ChannelLoads, ChannelScore, SlopeScore, Split, channel_loads, split
from flapgym.evaluation.compare import compare
from flapgym.evaluation.comparison import SCORED_SEED, Comparison, Plan, Score, plan, run
from flapgym.evaluation.lifetime import lifetime
from flapgym.evaluation.lifetime_loads import (
    WindBin,
    class_mean,
    lifetime_change,
    lifetime_load,
    weibull_share,
    wind_bins,
)
from flapgym.evaluation.lifetime_report import lifetime_json, lifetime_markdown, lifetime_text, write_lifetime
from flapgym.evaluation.lifetime_study import (
    Lifetime,
    LifetimeDuty,
    LifetimeLoad,
    LifetimePlan,
    plan_lifetime,
    run_lifetime,
)
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
    "Lifetime",
    "LifetimeDuty",
    "LifetimeLoad",
    "LifetimePlan",
    "Metrics",
    "Plan",
    "Record",
    "Score",
    "SlopeScore",
    "Split",
    "WindBin",
    "as_dataset",
    "as_json",
    "as_markdown",
    "as_text",
    "bands",
    "channel_loads",
    "class_mean",
    "compare",
    "damage_equivalent_load",
    "damage_equivalent_loads",
    "lifetime",
    "lifetime_change",
    "lifetime_json",
    "lifetime_load",
    "lifetime_markdown",
    "lifetime_text",
    "measure",
    "paired_change",
    "plan",
    "plan_lifetime",
    "root_mean_square",
    "run",
    "run_lifetime",
    "simulate",
    "simulate_together",
    "split",
    "steady_loads",
    "summed_damage_change",
    "summed_damage_load",
    "weibull_share",
    "wind_bins",
    "writable_folder",
    "write_lifetime",
    "write_report",
    "write_series",
]
