"""Damage over a life against closed forms, what is kept of an interrupted study, and what is refused."""

import csv
import json
import math
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.stats
from scipy.io import netcdf_file

from flapgym import cli
from flapgym.control import OpenLoop, PDGains, pd_agent, save_agent
from flapgym.control.scheduled import ScheduledAgent
from flapgym.evaluation import (
    class_mean,
    damage_equivalent_load,
    damage_equivalent_loads,
    lifetime,
    lifetime_change,
    lifetime_load,
    lifetime_markdown,
    lifetime_study,
    lifetime_text,
    plan_lifetime,
    run_lifetime,
    simulate,
    weibull_share,
    wind_bins,
)
from flapgym.evaluation.lifetime_loads import YEAR
from flapgym.evaluation.lifetime_store import FOLDER, key_of
from flapgym.evaluation.lifetime_study import duty
from flapgym.evaluation.record import Record
from flapgym.model import ModelSet, save_model_set
from flapgym.model.nameplate import nameplate
from tests.synthetic import synthetic_model

STRIPS = len(nameplate(synthetic_model().case).strip_radii)
MODEL = synthetic_model(strips=STRIPS, pitch=True)
MODELS = ModelSet.of([MODEL, replace(MODEL, wind_speed=15.0, name="faster")])
PD = pd_agent("pd", MODEL, PDGains(5e-8, 0.1, 0.1, 9.0, 0.8))
SHORT = {"seeds": 2, "seed": 7, "duration": 12.0}
SLOPES = (3.0, 4.0, 10.0)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("life")
    return lifetime([PD, "individual_pitch"], MODELS, output=folder, **SHORT), folder


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    save_model_set(MODELS, "set.safetensors")

    def call(*arguments):
        try:
            code = cli.main([str(argument) for argument in arguments])
        except SystemExit as leaving:
            code = leaving.code
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return call


# How often the wind blows how fast.


@pytest.mark.parametrize("mean", [10.0, 8.5, 7.5])
def test_probabilities_of_the_bins_sum_to_that_of_their_ends(mean):
    bins = wind_bins(np.arange(5.0, 26.0, 2.0), mean)
    # A Rayleigh distribution of this mean, by an independent program.
    cdf = scipy.stats.rayleigh(scale=mean * math.sqrt(2.0 / math.pi)).cdf
    assert (bins[0].low, bins[-1].high) == (4.0, 26.0)
    assert sum(each.probability for each in bins) == pytest.approx(cdf(26.0) - cdf(4.0), rel=1e-12)
    for each in bins:
        assert each.probability == pytest.approx(cdf(each.high) - cdf(each.low), rel=1e-9)


def test_ends_of_bins_lie_halfway_and_those_outside_as_far_as_inside():
    bins = wind_bins([7.0, 11.0, 12.0], 8.5)
    assert [(each.low, each.high) for each in bins] == [(5.0, 9.0), (9.0, 11.5), (11.5, 12.5)]
    assert [(each.low, each.high) for each in wind_bins([11.0], 8.5)] == [(10.0, 12.0)]
    assert wind_bins([1.0, 5.0], 8.5)[0].low == 0.0


def test_classes_of_the_standard_have_their_means():
    assert [class_mean(name) for name in ("I", "II", "III")] == [10.0, 8.5, 7.5]


@pytest.mark.parametrize("shape", [1.0, 2.0, 3.0])
def test_the_distribution_has_its_mean(shape):
    speeds = np.linspace(0.0, 200.0, 4001)
    above = 1.0 - np.array([weibull_share(speed, 8.5, shape) for speed in speeds])
    # The mean of what is positive is the integral of the share above.
    assert np.trapezoid(above, speeds) == pytest.approx(8.5, rel=1e-4)


# Damage.


def test_a_life_of_two_bins_with_sinusoids_is_the_hand_calculation():
    time = 0.01 * np.arange(60_000)
    amplitudes, frequencies, shares = (1e6, 2e6), (0.5, 2.0), (0.3, 0.1)
    loads = [
        damage_equivalent_loads(a * np.sin(2.0 * np.pi * f * time), 0.01, SLOPES)[:, None, None]
        for a, f in zip(amplitudes, frequencies, strict=True)
    ]
    for place, slope in enumerate(SLOPES):
        # Of ranges 2 a, f a second in that share of the life, over one a second all the life.
        damage = sum(
            p * f * (2.0 * a) ** slope for a, f, p in zip(amplitudes, frequencies, shares, strict=True)
        )
        expected = damage ** (1.0 / slope)
        assert lifetime_load([each[place] for each in loads], shares, slope) == pytest.approx(
            expected, rel=3e-3
        )


def test_damage_adds_over_seeds():
    rng = np.random.default_rng(1)
    one, other = rng.uniform(1.0, 2.0, (2, 3, 3))
    together = lifetime_load([np.vstack([one, other])], [0.4], 8.0) ** 8.0
    apart = [lifetime_load([each], [0.4], 8.0) ** 8.0 for each in (one, other)]
    assert together == pytest.approx(0.5 * sum(apart), rel=1e-12)


def test_bins_of_one_share_are_seeds_of_one_bin():
    rng = np.random.default_rng(2)
    one, other = rng.uniform(1.0, 2.0, (2, 3, 3))
    assert lifetime_load([one, other], [0.2, 0.2], 4.0) == pytest.approx(
        lifetime_load([np.vstack([one, other])], [0.4], 4.0), rel=1e-12
    )


@pytest.mark.parametrize("slope", [3.0, 10.0])
def test_the_load_of_bins_is_that_of_their_histories_one_behind_the_other(slope):
    """Of bins that fill the life, each as long as it is likely: but for the cycle that closes over the seam."""
    rng = np.random.default_rng(3)
    slow, fast = np.cumsum(rng.standard_normal(30_000)) * 0.05, rng.standard_normal(90_000)
    # The seam at zero, so that it adds no jump of its own; the slow one comes back to it.
    slow -= np.linspace(slow[0], slow[-1], slow.size)
    fast[0] = fast[-1] = 0.0
    loads = [np.array([[damage_equivalent_load(each, 0.1, slope)]]) for each in (slow, fast)]
    whole = damage_equivalent_load(np.concatenate([slow, fast]), 0.1, slope)
    assert lifetime_load(loads, [0.25, 0.75], slope) == pytest.approx(whole, rel=2e-2)


def test_the_change_of_loads_that_are_all_lower_by_a_tenth_is_that_with_no_width():
    loads = [np.random.default_rng(place).uniform(1.0, 3.0, (6, 3)) for place in range(2)]
    change = lifetime_change([0.9 * each for each in loads], loads, [0.3, 0.2], 10.0)
    assert (change.mean, change.low, change.high) == pytest.approx((-0.1, -0.1, -0.1), rel=1e-9)


def test_the_interval_covers_the_change_of_the_population():
    """In 19 of 20 cases; a percentile interval of ten seeds in somewhat fewer."""
    rng, covered = np.random.default_rng(4), 0
    for _ in range(60):
        reference = rng.lognormal(0.0, 0.1, (2, 10, 1))
        ours = reference * rng.lognormal(-0.1, 0.05, reference.shape)
        estimate = lifetime_change(list(ours), list(reference), [0.3, 0.3], 3.0)
        # Of logarithmically normal ratios apart from the loads: mean of the third powers.
        truth = math.exp(-0.1 + 0.5 * 3.0 * 0.05**2) - 1.0
        covered += estimate.low <= truth <= estimate.high
    assert covered >= 0.8 * 60


def test_one_seed_gives_no_interval():
    change = lifetime_change([np.array([[1.0]])], [np.array([[2.0]])], [0.5], 4.0)
    assert (change.mean, change.low, change.high) == (-0.5, None, None)


# Duty.


def test_duty_of_a_sinusoid_is_its_closed_form():
    time = np.arange(0.0, 100.0, 0.01)
    amplitude, turn = 0.1, 2.0 * np.pi * 0.5
    angle = np.broadcast_to(amplitude * np.sin(turn * time)[None, :, None], (1, time.size, 3))
    rate = np.broadcast_to(amplitude * turn * np.cos(turn * time)[None, :, None], angle.shape)
    still = np.zeros((1, time.size))
    record = Record(
        angle, angle, angle, rate, still, still, still, np.zeros(1), 0.01, pitch_angle=0.5 * angle
    )
    found, stop = duty(record, MODEL), MODEL.flaps[0].angle_limit
    assert found.flap_travel == pytest.approx([4.0 * amplitude * 0.5], rel=1e-3)
    assert found.flap_cycles == pytest.approx([0.5 * amplitude / stop], rel=1e-3)
    assert found.flap_rate_max == pytest.approx([amplitude * turn], rel=1e-3)
    # Twice a period the flap is brought from rest to its largest rate.
    assert found.flap_power == pytest.approx([2.0 * 0.5 * 0.5 * (amplitude * turn) ** 2], rel=1e-2)
    assert found.pitch_travel == pytest.approx([2.0 * amplitude * 0.5], rel=1e-3)


def test_collective_pitch_is_pitched_by_every_blade():
    still = np.zeros((1, 50))
    blades = np.zeros((1, 50, 3))
    ramp = np.linspace(0.0, 0.3, 50)[None]
    record = Record(
        blades, blades, blades, blades, still, still, still, np.zeros(1), 0.1, {"collective_pitch": ramp}
    )
    assert duty(record, MODEL).pitch_travel == pytest.approx([0.3 / 5.0])


# The study.


def test_the_study_is_the_sum_of_what_each_bin_gives_alone(study):
    life, _ = study
    probability = [each.probability for each in life.bins]
    settings = plan_lifetime([PD], MODELS, **SHORT).settings
    load = next(each for each in life.loads["pd"] if (each.channel, each.slope) == ("rbm", 10.0))
    parts = []
    for model, seeds in zip(MODELS, life.seeds, strict=True):
        record = simulate(PD, model, seeds, SHORT["duration"], **settings)
        parts.append(
            np.array(
                [
                    [damage_equivalent_load(record.rbm[n, :, b], model.time_step) for b in range(3)]
                    for n in range(2)
                ]
            )
        )
    expected = sum(p * np.mean(part**10.0) for p, part in zip(probability, parts, strict=True)) ** 0.1
    assert load.equivalent_load == pytest.approx(expected, rel=1e-6)


def test_damage_by_wind_speed_adds_up_to_the_change(study):
    for loads in study[0].loads.values():
        for load in loads:
            assert sum(load.damage) == pytest.approx((1.0 + load.change.mean) ** load.slope, rel=1e-9)


def test_open_loop_changes_nothing_and_moves_nothing(study):
    life, _ = study
    assert {load.change.mean for load in life.loads["open_loop"]} == {0.0}
    assert set(vars(life.duties["open_loop"]).values()) == {0.0}


def test_cycles_over_the_life_follow_from_the_mean_travel(study):
    life, _ = study
    found, stop = life.duties["pd"], MODEL.flaps[0].angle_limit
    running = life.running * life.years * YEAR
    assert found.flap_cycles == pytest.approx(found.flap_travel * running / (4.0 * stop), rel=1e-3)


def test_agents_say_what_they_were_designed_for(study):
    assert study[0].designed == {"open_loop": "any", "pd": "11 m/s", "individual_pitch": "each speed"}


def test_a_gain_scheduled_agent_is_in_each_wind_the_one_that_it_takes_there():
    weak = pd_agent("weak", MODEL, PDGains(2e-8, 0.1, 0.1, 9.0, 0.8))
    planned = plan_lifetime([ScheduledAgent("scheduled", (11.0, 15.0), (PD, weak))], MODELS, **SHORT)
    there = [each[1] for each in planned.agents]
    assert [agent.name for agent in there] == ["scheduled", "scheduled"]
    assert [agent.system for agent in there] == [PD.system, weak.system]


class _Named(OpenLoop):
    """Not to be named anew."""

    def __init__(self, name):
        self.name = name


def test_agents_of_other_names_in_each_wind_are_refused():
    scheduled = ScheduledAgent("both", (11.0, 15.0), (_Named("slow"), _Named("fast")))
    with pytest.raises(ValueError, match="agents: expected the same names at every wind speed, got .* and"):
        plan_lifetime([scheduled], MODELS, **SHORT)


def test_files_say_what_the_data_say(study):
    life, folder = study
    document = json.loads((folder / "lifetime.json").read_text())
    rows = list(csv.DictReader((folder / "lifetime.csv").read_text().splitlines()))
    assert list(document["agents"]) == list(life.loads)
    assert len(rows) == sum(len(loads) for loads in life.loads.values())
    of_pd = [row for row in rows if row["agent"] == "pd"]
    for row, load, entry in zip(of_pd, life.loads["pd"], document["agents"]["pd"]["loads"], strict=True):
        assert float(row["change"]) == load.change.mean == entry["change"]["mean"]
        assert float(row["damage_at_15_m_per_s"]) == load.damage[1]
    assert (folder / "lifetime.md").read_text() == lifetime_markdown(life)
    assert (folder / "lifetime.png").read_bytes().startswith(b"\x89PNG")


def test_the_table_says_what_is_left_out(study):
    text = lifetime_text(study[0], 1000)
    assert re.search(r"wind below 9 and above 17 m/s, 62\.9% of the life", text)
    assert "Without gravity" in text
    assert "hinge moment of the air is not in the model" in text


def test_only_models_that_hold_the_speed_are_said_to_overstate_slow_loads(study):
    life, _ = study
    assert "The rotor's speed is held" in lifetime_markdown(life)
    assert "The rotor's speed is held" not in lifetime_markdown(replace(life, speed_loop=True))


def test_an_agent_added_later_meets_the_same_wind_and_the_others_are_taken_up(study):
    before, folder = study
    after = lifetime([PD, "individual_pitch", replace(PD, name="other")], MODELS, output=folder, **SHORT)
    assert set(after.taken_up) == {"open_loop", "pd", "individual_pitch"}
    assert after.loads["pd"] == before.loads["pd"]
    for one, other in zip(after.loads["pd"], after.loads["other"], strict=True):
        assert one.change.mean == pytest.approx(other.change.mean, rel=1e-6)


def test_an_interrupted_study_goes_on_and_ends_with_the_same_table(study, tmp_path, monkeypatch):
    whole, _ = study
    planned = plan_lifetime([PD, "individual_pitch"], MODELS, **SHORT)
    with monkeypatch.context() as patch:
        simulated = lifetime_study.simulate_together

        def until_the_second_bin(agents, model, *arguments, **keywords):
            if model.name == "faster":
                raise KeyboardInterrupt
            return simulated(agents, model, *arguments, **keywords)

        patch.setattr(lifetime_study, "simulate_together", until_the_second_bin)
        with pytest.raises(KeyboardInterrupt):
            run_lifetime(planned, folder=tmp_path)
    assert len(list((tmp_path / FOLDER).glob("11mps-*.json"))) == 3
    resumed = run_lifetime(planned, folder=tmp_path)
    assert set(resumed.taken_up) == {"open_loop", "pd", "individual_pitch"}
    assert resumed.loads == whole.loads
    assert resumed.duties == whole.duties


def test_a_damaged_file_is_found_again(study, tmp_path):
    planned = plan_lifetime([OpenLoop()], MODELS, [11.0], **SHORT)
    first = run_lifetime(planned, folder=tmp_path)
    (file,) = (tmp_path / FOLDER).iterdir()
    file.write_text("{")
    again = run_lifetime(planned, folder=tmp_path)
    assert (again.taken_up, again.loads) == ((), first.loads)
    assert run_lifetime(planned, folder=tmp_path).taken_up == ("open_loop",)


@dataclass(frozen=True)
class _Sealed(OpenLoop):
    """What it does cannot be seen from outside."""

    name: str = "sealed"
    code: object = min


def test_keys_differ_with_whatever_counts_and_what_cannot_be_seen_has_none():
    base = key_of(PD, {"seeds": [1]})
    system = replace(PD.system, D=PD.system.D * (1.0 + 1e-15))
    for agent, conditions in ((PD, {"seeds": [2]}), (replace(PD, system=system), {"seeds": [1]})):
        assert key_of(agent, conditions) != base
    assert key_of(replace(PD), {"seeds": [1]}) == base
    assert key_of(_Sealed(), {}) is None


def test_series_are_written_with_units_and_hold_the_record(tmp_path):
    lifetime([OpenLoop()], MODELS, [11.0], seeds=1, seed=7, duration=12.0, save_series=tmp_path)
    (path,) = tmp_path.iterdir()
    planned = plan_lifetime([OpenLoop()], MODELS, [11.0], seeds=1, seed=7, duration=12.0)
    record = simulate(OpenLoop(), MODEL, [7], 12.0, **planned.settings)
    with netcdf_file(path, mmap=False) as file:
        assert (path.name, file.variables["rbm"].units) == ("11mps-open_loop-seed7.nc", b"N m")
        np.testing.assert_allclose(file.variables["rbm"][:], record.rbm, rtol=1e-6)
        assert file.variables["rbm"].dimensions == ("realisation", "time", "blade")
        assert file.variables["rbm"].typecode() == "f"
        assert (list(file.variables["realisation"][:]), file.agent) == ([7], b"open_loop")
        assert file.variables["time"][0] == MODEL.time_step


def test_series_with_seeds_beyond_their_files_are_refused_before_any_work(tmp_path):
    folder = tmp_path / "series"
    with pytest.raises(ValueError, match="save_series: expected seeds up to 2147483647, got 2147483688"):
        plan_lifetime([OpenLoop()], MODELS, seeds=1, seed=2**31, save_series=folder)
    assert not folder.exists()


# What is refused.


def test_the_command_writes_its_table_and_takes_up_what_it_found(run, tmp_path):
    save_agent("mine.json", PD, MODEL, "a test", {})
    command = ("lifetime", "--models", "set.safetensors", "--agents", "mine.json", "--seeds", 1, "--seed", 7)
    code, out, _ = run(*command, "--duration", 12, "--wind-speeds", 15, "--output", "out")
    assert code == 0
    assert "wrote lifetime.* in out" in out
    code, out, err = run(*command, "--duration", 12, "--wind-speeds", 15, "--output", "out", "--years", 25)
    told = " ".join(out.split())  # lines are broken
    assert (code, "Taken up from an earlier run" in told, "25 years" in told) == (0, True, True), err


def test_an_interrupt_says_that_what_is_found_is_kept(run, monkeypatch):
    def interrupted(*arguments, **keywords):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "run_lifetime", interrupted)
    code, out, err = run("lifetime", "--models", "set.safetensors", "--agents", "open_loop")
    assert (code, out) == (130, "")
    assert err == (
        "flapgym lifetime: interrupted; finished wind speeds are kept, and the next run takes them up\n"
    )


@pytest.mark.parametrize(
    "arguments, parts",
    [
        (["--wind-speeds", "8"], ["wind_speeds", "some of 11, 15 m/s", "8 m/s"]),
        (["--wind-speeds", "11", "11"], ["wind_speeds", "each value once"]),
        (["--wind-speeds", "fast"], ["--wind-speeds", "fast"]),
        (["--seeds", "0"], ["--seeds", "from 1 to 40"]),
        (["--duration", "1"], ["--duration", "from 10"]),
        (["--class", "D"], ["--class", "'D'"]),
        (["--wind-class", "IV"], ["--wind-class", "'IV'"]),
        (["--years", "0"], ["--years", "from 0.01 to 100 years"]),
        (["--agents", "nobody"], ["agent nobody", "unknown"]),
        (["--models", "nowhere.safetensors"], ["nowhere.safetensors", "no such file"]),
        (["--output", "set.safetensors"], ["output set.safetensors", "folder"]),
        (["--save-series", "set.safetensors"], ["output set.safetensors", "folder"]),
    ],
)
def test_bad_input_costs_one_line_and_leaves_no_folder(run, tmp_path, arguments, parts):
    code, out, err = run("lifetime", "--models", "set.safetensors", *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1), err
    for part in parts:
        assert part in err
    assert not list(tmp_path.glob("results/*"))


@pytest.mark.parametrize(
    "call, text",
    [
        (lambda: wind_bins([5.0, 4.0], 8.5), "wind_bins.wind_speeds: expected"),
        (lambda: wind_bins([], 8.5), "wind_bins.wind_speeds: expected"),
        (lambda: wind_bins([5.0], 0.0), "wind_bins.mean: expected"),
        (lambda: class_mean("IV"), "class_mean.wind_class: expected"),
        (lambda: weibull_share(-1.0, 8.5), "weibull_share.wind_speed: expected"),
        (lambda: weibull_share(1.0, 8.5, 0.0), "weibull_share.shape: expected"),
        (lambda: lifetime_load([np.ones((1, 1))], [0.1, 0.2], 3.0), "lifetime_load.loads: expected"),
        (lambda: lifetime_load([-np.ones((1, 1))], [0.1], 3.0), r"lifetime_load.loads\[0\]: expected"),
        (lambda: lifetime_load([np.ones((1, 1))], [1.1], 3.0), "lifetime_load.probabilities"),
        (lambda: lifetime_load([np.ones((1, 1))], [0.1], 0.0), "lifetime_load.slope: expected"),
        (
            lambda: lifetime_change([np.ones((2, 1))], [np.ones((1, 1))], [0.1], 3.0),
            "lifetime_change.reference: expected",
        ),
        (
            lambda: lifetime_change([np.ones((2, 1))], [np.zeros((2, 1))], [0.1], 3.0),
            "lifetime_change.reference: expected a positive load",
        ),
        (lambda: plan_lifetime([PD], MODELS, seeds=True), "seeds: expected"),
        (lambda: plan_lifetime([PD], MODELS, seed=-1), "seed: expected"),
        (lambda: plan_lifetime([PD], MODELS, duration=math.nan), "duration: expected"),
        (lambda: plan_lifetime([PD], MODELS, turbulence_class="D"), "turbulence_class: expected"),
        (lambda: plan_lifetime([PD], MODELS, wind_class="IV"), "wind_class: expected"),
        (lambda: plan_lifetime([PD], MODELS, years=0.0), "years: expected"),
        (lambda: plan_lifetime("pd", MODELS), "agents: expected a list"),
        (lambda: plan_lifetime([PD], ModelSet.of([synthetic_model()])), "wind.field: expected a model with"),
        (
            lambda: plan_lifetime(["individual_pitch"], ModelSet.of([synthetic_model(strips=STRIPS)])),
            "individual_pitch: expected a model with pitch",
        ),
    ],
)
def test_arguments_without_meaning_are_refused_by_name(call, text):
    with pytest.raises(ValueError, match=text) as refused:
        call()
    assert "\n" not in str(refused.value)
