"""The study as a section of a report."""

from __future__ import annotations

import numpy as np

from baselines.margins_table import margins_table
from baselines.rivals.bound import HOLD
from baselines.rivals.equal_load import EqualLoad
from baselines.rivals.study import NOISES, Findings, Outcome
from baselines.scores import CHANGES
from flapgym.core.arrays import Array
from flapgym.evaluation import paired_change
from studies.document import Section, Table, percent

EQUAL = ("LQG", "PD", "PID", "LQG, acceleration weighed 1000 times, 10 % noise expected")


def rivals_section(findings: Findings) -> Section:
    """All of it."""
    found, ideal = findings.all_outcomes, findings.ideal
    reference, base = found["open_loop"][1], found["lqg"][1]
    rows = [_row(rival.label, outcome, reference, base) for rival, outcome in list(found.values())[1:]]
    rows.append(_row("bound: best motion, wind known", ideal.outcome, reference, base))
    promised = np.sqrt(np.mean(ideal.outcome.metrics.rbm_rms**2, axis=1)) / ideal.programme_rms - 1.0
    spent = 1e6 * findings.solve_times
    return Section(
        "Rivals of the LQG, and the bound",
        (
            f"Change against open loop on the same {findings.realisations} realisations of {findings.duration:.0f} s, "
            "mean of the ratios over blades and realisations, 95 % paired bootstrap interval. "
            "Power is over that of the LQG whose flap "
            "just meets its stop: to move the flap's inertia (mean modulus of rate times acceleration), and against a "
            "hinge moment in proportion to the angle (mean modulus of angle times rate).",
            Table(
                (
                    "controller",
                    *(f"{label} [%]" for label in CHANGES.values()),
                    "travel [deg/s]",
                    "rate rms [deg/s]",
                    "inertial power",
                    "hinge power",
                    "time at the stop [%]",
                    "largest rate [deg/s]",
                ),
                tuple(rows),
            ),
            "The bound is the least mean square of the blades' mean moment that a common flap motion within the stops "
            "of angle, rate and acceleration can have over each realisation, the whole wind known. Largest duality gap "
            f"{ideal.gap.max():.0e} of the mean square, largest violation of the optimality conditions "
            f"{ideal.residual.max():.0e}; the acceleration is held over {HOLD} steps. Played back on the whole turbine "
            f"its rms moment is {100 * promised.mean():+.2f} % off what the programme promises (the reduced response, "
            "and what the blades differ by). Tip deflection and DEL are of the same motion, which is best in the "
            "moment's mean square, not in them.",
            _alone(findings.single_blade),
            f"Of the predictive controller's optima on a minute of wind, {spent.size} had a stop in sight; one took "
            f"{np.median(spent):.0f} microseconds (median), {np.percentile(spent, 99):.0f} (99 of 100), "
            f"{spent.max():.0f} (most), on one core, of "
            f"{1e3 * findings.time_step:g} ms.",
            _horizons(findings),
            "Margins of MPC's full closed loop while no stop is in sight, the wind it is told being calm:",
            margins_table(findings.margins),
            _steady(findings),
            "Actuator duty at the load of that LQG: gains of PD and PID, and the weight on the moment of an LQG that "
            "weighs acceleration a thousand times as heavily and expects 10 % of noise, brought to its rms moment, by "
            "Lyapunov equations (stops left out).",
            _equal_load(findings.equal_load),
        ),
        conclusions=(_summary(found["lqg_saturating"][1], found["mpc"][1], ideal.outcome, reference),),
    )


def _alone(found: dict[str, Array]) -> str:
    """The bound on the clamped blade."""
    change = {key: 100.0 * float(np.mean(value[:, 1] / value[:, 0] - 1.0)) for key, value in found.items()}
    return (
        f"On the clamped blade alone the bound is {change['rbm_rms']:.1f} / {change['tip_rms']:.1f} / "
        f"{change['rbm_del']:.1f} % (RBM rms, tip rms, DEL; the first {len(found['rbm_rms'])} realisations)."
    )


def _row(label: str, ours: Outcome, reference: Outcome, base: Outcome) -> tuple[str, ...]:
    changes = [paired_change(getattr(ours.metrics, key), getattr(reference.metrics, key)) for key in CHANGES]
    duty = ours.duty
    return (
        label,
        *(percent(change) for change in changes),
        f"{np.rad2deg(duty.travel.mean()):.2f}",
        f"{np.rad2deg(duty.rate_rms.mean()):.2f}",
        f"{duty.inertial_power.mean() / base.duty.inertial_power.mean():.2f}",
        f"{duty.hinge_power.mean() / base.duty.hinge_power.mean():.2f}",
        f"{100 * duty.at_stop.mean():.1f}",
        f"{np.rad2deg(ours.metrics.flap_rate_max.max()):.0f}",
    )


def _summary(saturating: Outcome, mpc: Outcome, ideal: Outcome, reference: Outcome) -> str:
    """How much of what is possible the causal controllers take."""
    falls = {
        name: -100.0 * paired_change(each.metrics.rbm_rms, reference.metrics.rbm_rms).mean
        for name, each in (("saturating", saturating), ("mpc", mpc), ("bound", ideal))
    }
    between = paired_change(mpc.metrics.rbm_rms, saturating.metrics.rbm_rms)
    return (
        f"The saturating LQG takes {falls['saturating']:.1f} of the {falls['bound']:.1f} % that are possible, MPC of "
        f"the same weights {falls['mpc']:.1f}: knowing the stops changes the RBM rms by {percent(between)} %."
    )


def _steady(findings: Findings) -> str:
    """What tilt and yaw channels are for."""
    told = ", ".join(f"{name} {100.0 * share:.0f} %" for name, share in findings.steady_shares.items())
    return f"Of a steady tilting or yawing moment the linear loops leave: {told}."


def _horizons(findings: Findings) -> str:
    """What the length of the horizon is worth."""
    found = findings.horizons
    (own, base), *others = found.items()
    told = ", ".join(f"{100.0 * (value - base):+.2f} ({label})" for label, value in others)
    return (
        f"Another horizon than MPC's {own} changes the RBM rms by, in points on the first {findings.few} "
        f"realisations: {told}."
    )


def _equal_load(found: Array) -> Table:
    columns = list(EqualLoad.__dataclass_fields__)
    rows = []
    for noise, controllers in zip(NOISES, found, strict=True):
        base = dict(zip(columns, controllers[0], strict=True))
        for label, values in zip(EQUAL, controllers, strict=True):
            one = dict(zip(columns, values, strict=True))
            rows.append(
                (
                    f"{100 * noise:g} %",
                    label,
                    f"{100 * one['rbm_change']:+.1f}",
                    *(f"{np.rad2deg(one[key]):.2f}" for key in ("angle_rms", "travel", "rate_rms")),
                    *(f"{one[key] / base[key]:.2f}" for key in ("inertial_power", "hinge_power")),
                )
            )
    head = ("noise", "controller", "RBM rms [%]", "flap rms [deg]", "travel [deg/s]", "rate rms [deg/s]")
    return Table((*head, "inertial power", "hinge power"), tuple(rows))
