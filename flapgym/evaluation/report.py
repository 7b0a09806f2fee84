"""The comparison as a table for people and as files: JSON, CSV, Markdown and a figure."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from flapgym.core.atomic import check_target, write_together
from flapgym.core.wording import number
from flapgym.evaluation.channels import ChannelScore
from flapgym.evaluation.comparison import Comparison, Score
from flapgym.evaluation.figure import draw_figure, figure_is_possible
from flapgym.evaluation.metrics import EQUIVALENT_FREQUENCY, FATIGUE_SLOPE
from flapgym.evaluation.tables import markdown_table, percent, plain_name, text_table

CHANGES = {
    "rbm_rms_change": "RBM rms",
    "tip_rms_change": "tip rms",
    "rbm_del_change": "RBM DEL",
    "rbm_del_summed_change": "RBM DEL, damage summed",
    "tower_rms_change": "tower rms",
}
FEW = 10
"""Below this number of realisations the table calls its intervals indicative."""

CHANNELS_CAPTION = (
    "Every load channel by S-N slope. DEL [%]: mean of the realisations' ratios to open loop, each realisation of one "
    "weight. DEL and DEL, damage summed [%]: of the damage of all blades and realisations together."
)
STEADY_CAPTION = (
    "Turbulence alone: less what shear, tower and weight do to flaps at rest, the same under every agent. A flap that "
    "takes some of that off lowers all loads, and is charged for it in turbulence alone."
)

FILES = ("compare.json", "compare.csv", "compare.md", "compare.png")


def writable_folder(output: str | os.PathLike[str], files: Iterable[str] = ()) -> Path:
    """The folder for the results, made if missing; refused if nothing, or one of these files not, can be written."""
    folder = Path(output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"output {folder}: cannot make this folder ({error.strerror})") from None
    if not os.access(folder, os.W_OK):
        raise ValueError(f"output {folder}: cannot write in this folder; name another")
    for name in files:
        check_target(folder / name)
    return folder


def write_report(comparison: Comparison, folder: str | os.PathLike[str]) -> None:
    """Write compare.json, .csv, .md and, where matplotlib is installed, .png: all of them or none."""
    folder = Path(folder)
    document = json.dumps(as_json(comparison), indent=2, allow_nan=False) + "\n"
    contents = [document.encode(), as_csv(comparison).encode(), as_markdown(comparison).encode()]
    if figure_is_possible():
        contents.append(draw_figure(comparison))
    write_together({folder / name: content for name, content in zip(FILES, contents, strict=False)})


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Plain values in SI units; changes are fractions of open loop."""
    return {
        "model": {
            "name": comparison.model_name,
            "hash": comparison.model_hash,
            "turbine": comparison.nameplate.turbine,
            "rotor_radius": comparison.nameplate.rotor_radius,
            "hub_height": comparison.nameplate.hub_height,
        },
        "realisations": comparison.realisations,
        "seed": comparison.seed,
        "duration": comparison.duration,
        "environment": comparison.environment,
        "agents": {
            name: asdict(score) | _growth(comparison, name) | _channels(comparison, name)
            for name, score in comparison.scores.items()
        },
    }


def _growth(comparison: Comparison, name: str) -> dict[str, float | None]:
    """Frequency [Hz] and doubling time [s] of what grows in an agent's linear loop; None where nothing does."""
    grows = comparison.growths.get(name)
    values = (np.nan, np.nan) if grows is None else (grows.frequency, grows.doubling_time)
    names = ("growth_frequency", "doubling_time")
    return {key: value if np.isfinite(value) else None for key, value in zip(names, values, strict=True)}


def _channels(comparison: Comparison, name: str) -> dict[str, list[dict[str, Any]]]:
    """An agent's entry of channels, where they were scored."""
    scores = comparison.channels.get(name)
    return {} if scores is None else {"channels": [_channel(score) for score in scores]}


def _channel(score: ChannelScore) -> dict[str, Any]:
    """A channel's entry; `turbulence_alone` is in it where something else loads the turbine, too."""
    entry = asdict(score)
    alone = entry.pop("turbulence")
    if alone is not None:
        # Of the channel named above it.
        entry["turbulence_alone"] = {name: alone[name] for name in ("unit", "rms", "rms_change", "slopes")}
    return entry


def as_csv(comparison: Comparison) -> str:
    """One row an agent, the three numbers of a change in columns of their own."""
    rows = []
    for name, score in comparison.scores.items():
        row: dict[str, Any] = {"agent": plain_name(name)}
        for field, value in asdict(score).items():
            if isinstance(value, dict):
                row |= {f"{field}_{key}": entry for key, entry in value.items()}
            else:
                row[field] = value
        rows.append(row | _growth(comparison, name))
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def as_markdown(comparison: Comparison) -> str:
    """The table with its caption and remarks, and that of the channels where they were scored."""
    lines = [_caption(comparison), "", *markdown_table(*_cells(comparison)), "", *_remarks(comparison)]
    if comparison.channels:
        lines += ["", *_channels_caption(comparison), "", *markdown_table(*_channel_cells(comparison))]
    return "\n".join(lines) + "\n"


def as_text(comparison: Comparison) -> str:
    """The same for a terminal."""
    lines = [_caption(comparison), "", *text_table(*_cells(comparison)), "", *_remarks(comparison)]
    if comparison.channels:
        lines += ["", *_channels_caption(comparison), "", *text_table(*_channel_cells(comparison))]
    return "\n".join(lines)


def _cells(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    header = ["agent", *(f"{label} [%]" for label in CHANGES.values())]
    header += ["RBM rms [MN m]", "RBM DEL [MN m]", "max angle [deg]", "max rate [deg/s]", "travel [deg/s]"]
    rows = [_row(name, score) for name, score in comparison.scores.items()]
    if any(score.pitch_travel for score in comparison.scores.values()):
        header.append("pitch travel [deg/s]")
        for row, score in zip(rows, comparison.scores.values(), strict=True):
            row.append(f"{np.rad2deg(score.pitch_travel):.2f}")
    return header, rows


def _told_apart(comparison: Comparison) -> bool:
    """Whether turbulence alone is told beside all loads."""
    return any(score.turbulence is not None for scores in comparison.channels.values() for score in scores)


def _channels_caption(comparison: Comparison) -> list[str]:
    return [CHANNELS_CAPTION, STEADY_CAPTION] if _told_apart(comparison) else [CHANNELS_CAPTION]


def _channel_cells(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    loads = ["rms", "rms [%]", "DEL", "DEL [%]", "DEL, damage summed [%]"]
    header = ["channel", "S-N slope", "agent"]
    if _told_apart(comparison):
        header += [f"{whose}: {load}" for whose in ("all loads", "turbulence alone") for load in loads]
    else:
        header += loads
    by_channel = zip(*comparison.channels.values(), strict=True)
    rows = []
    for agents in by_channel:
        for place in range(len(agents[0].slopes)):
            for name, score in zip(comparison.channels, agents, strict=True):
                row = [score.channel, number(score.slopes[place].slope), name]
                for each in (score, score.turbulence):
                    row += [] if each is None else _load_cells(each, place)
                rows.append(row)
    return header, rows


def _load_cells(score: ChannelScore, place: int) -> list[str]:
    at = score.slopes[place]
    return [
        _with_unit(score.rms, score.unit),
        percent(score.rms_change),
        _with_unit(at.equivalent_load, score.unit),
        percent(at.change),
        percent(at.summed_change),
    ]


def _with_unit(value: float, unit: str) -> str:
    if unit == "N m":
        return f"{value / 1e6:.3f} MN m"
    return f"{value:.4g} {unit}".rstrip()


def _row(name: str, score: Score) -> list[str]:
    cells = [name if score.made_for_this_model else f"{name} *"]
    cells += [percent(getattr(score, field)) for field in CHANGES]
    cells += [f"{value / 1e6:.3f}" for value in (score.rbm_rms, score.rbm_del)]
    cells += [
        f"{np.rad2deg(value):.2f}" for value in (score.flap_angle_max, score.flap_rate_max, score.flap_travel)
    ]
    return cells


def _caption(comparison: Comparison) -> str:
    count = comparison.realisations
    where = "" if comparison.environment is None else f"environment {comparison.environment}, "
    return (
        f"Change against open loop on the same {count} realisation{'s' if count > 1 else ''} of "
        f"{comparison.duration:.0f} s, {where}model {comparison.model_name} ({comparison.model_hash[:12]}), "
        f"turbine {comparison.nameplate.size}: "
        "mean of the ratios over blades and realisations, 95 % paired bootstrap interval."
    )


def _remarks(comparison: Comparison) -> list[str]:
    remarks = [
        f"DEL: damage-equivalent load, S-N slope {number(FATIGUE_SLOPE)}, {number(EQUIVALENT_FREQUENCY)} Hz. With the "
        "damage summed over all realisations first, those of the largest loads decide, as in a lifetime."
    ]
    if comparison.realisations == 1:
        remarks.append("One realisation gives no interval.")
    elif comparison.realisations < FEW:
        remarks.append(f"Intervals from {comparison.realisations} realisations are indicative.")
    if any(not score.made_for_this_model for score in comparison.scores.values()):
        remarks.append("* made for another model than this one.")
    for name, grows in comparison.growths.items():
        remarks.append(f"{name}: its linear loop {grows}; here the stops bound it.")
    if not figure_is_possible():
        remarks.append("No figure: matplotlib is not installed (pip install 'flapgym[baselines]').")
    return remarks
