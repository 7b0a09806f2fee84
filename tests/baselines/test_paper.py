"""The study of Section IV: it reports what it measured, keeps what it finished, and refuses what it cannot do."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from baselines import scores
from baselines.cache import Cache
from baselines.paper import __main__ as program
from baselines.paper import study as study_module
from baselines.paper import turbine_sections
from baselines.paper.control_sections import gust_alleviation, more, robustness
from baselines.paper.controllers import Plants, swaying_wind
from baselines.paper.groundwork import Job, stages, worked
from baselines.paper.readings import Reading, readings_section
from baselines.paper.structure_sections import table_2
from baselines.paper.turbine_sections import _lag
from baselines.robustness import CONDITIONS, MARGINS, margins, sensitivity
from baselines.scores import score
from flapgym.control import Weights, closed_loop, lqg_agent, stationary_rms
from flapgym.control.closed_loop import with_effectiveness
from flapgym.control.margins import late_measurement
from flapgym.core.state_space import StateSpace
from flapgym.evaluation import Estimate, Metrics
from flapgym.model import load_model, save_model
from flapgym.turbine import load_case
from reference.study import STUDY_OUTPUTS
from studies.bode import OWN, PARKED, RIGID, SOFT, Curves
from studies.document import Section, Table, summary
from studies.render import as_html, as_markdown
from studies.tips import CYCLES, Tips
from tests.scaled import small_case
from tests.synthetic import synthetic_model

MODEL = synthetic_model()


def _sampled(model, time_step):
    """The model as if its matrices were of another step."""
    systems = {name: replace(getattr(model, name), time_step=time_step) for name in ("turbine", "blade")}
    return replace(model, time_step=time_step, **systems)


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(study_module, "QUICK_DURATION", 4.0)
    monkeypatch.setattr(study_module, "QUICK", {"lqg"})
    # What is replaced here is not in another process.
    monkeypatch.setattr(program, "PROCESSES", 1)
    # The real one takes as long as a build; here the tower's top and the flapwise moments stand for its outputs.
    chosen = load_model("nrel5mw-rated").turbine.select(
        outputs=("rbm_0", "rbm_c", "rbm_s", "tower_fore_aft", "tower_side_side")
    )
    monkeypatch.setattr(study_module, "study_turbine", lambda case: replace(chosen, outputs=STUDY_OUTPUTS))


def test_a_finished_part_is_not_computed_again(short, tmp_path, monkeypatch):
    arguments = ["gust_alleviation", "--quick", "--output", str(tmp_path)]
    assert program.main(arguments) == 0
    first = (tmp_path / "paper-trial.md").read_text()
    assert "single clamped blade (base case)" in first

    def never(*_):
        raise AssertionError("simulated again")

    monkeypatch.setattr(scores, "simulate_together", never)
    assert program.main(arguments) == 0
    assert (tmp_path / "paper-trial.md").read_text() == first
    rules = [line for line in first.splitlines() if line.startswith("| --- ")]
    assert (tmp_path / "paper-trial.html").read_text().count("<table>") == len(rules)


@pytest.mark.parametrize(
    "arguments", [["figure7"], ["--model", "nowhere"], ["--realisations", "1"]], ids=lambda a: a[-1]
)
def test_bad_input_costs_one_line_and_exit_code_two(arguments, tmp_path, capsys):
    assert program.main([*arguments, "--output", str(tmp_path)]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("baselines.paper: ")
    assert arguments[-1] in error


def test_another_model_or_setting_finds_nothing_in_the_cache(tmp_path):
    calls = []

    def make():
        calls.append(None)
        return {"value": np.arange(3.0)}

    for stamp, setting in (("a", 1), ("a", 1), ("a", 2), ("b", 1)):
        found = Cache(tmp_path, stamp).arrays("part", {"setting": setting}, make)
        np.testing.assert_array_equal(found["value"], [0.0, 1.0, 2.0])
    assert len(calls) == 3


@pytest.mark.parametrize("content", [b"", b"PK", b"nonsense"])
def test_a_damaged_part_is_computed_again(tmp_path, content):
    cache = Cache(tmp_path, "a")
    cache.arrays("part", {}, lambda: {"value": np.arange(3.0)})
    path = cache.path("part", {})
    path.write_bytes(content)
    found = cache.arrays("part", {}, lambda: {"value": np.arange(4.0)})
    np.testing.assert_array_equal(found["value"], np.arange(4.0))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    assert cache.arrays("part", {}, lambda: {"value": np.arange(5.0)})["value"].size == 5


def test_a_system_comes_back_from_the_cache_as_it_was(tmp_path):
    cache = Cache(tmp_path, "a")
    cache.system("blade", {}, lambda: MODEL.blade)
    found = cache.system("blade", {}, lambda: pytest.fail("made again"))
    assert isinstance(found, StateSpace)
    assert (found.inputs, found.outputs, found.time_step) == (
        MODEL.blade.inputs,
        MODEL.blade.outputs,
        MODEL.blade.time_step,
    )
    np.testing.assert_array_equal(found.A, MODEL.blade.A)


def _metrics(factor, angle):
    one = np.full((4, 3), 1e6) * np.linspace(0.9, 1.1, 4)[:, None]
    return Metrics(
        factor * one, factor * one, factor * one, factor * one[:, 0], angle, angle, angle, 0.0 * angle
    )


def test_scores_are_changes_and_count_the_realisations_at_the_stop():
    limit = MODEL.flaps[0].angle_limit
    angles = np.array([0.5, 1.0, 0.9, 1.0]) * limit
    open_loop = _metrics(1.0, 0.0 * angles)
    found = score(_metrics(0.8, angles), open_loop, _metrics(0.75, angles), MODEL)
    assert found.changes["rbm_del"].mean == pytest.approx(-0.2)
    assert found.touching == 0.5
    assert found.against_base.mean == pytest.approx(-0.2)


def test_a_disagreement_with_the_paper_is_said():
    estimate = {"lqg": -0.195, "lqg_clamped_rotor": -0.19, "lqg_frozen": -0.15}
    made = {
        name: scores.Score(
            {key: Estimate(value, value, value) for key in scores.CHANGES},
            0.17,
            0.1,
            1.0,
            0.1,
            Estimate(value / -0.195 - 1.0, -0.3, 0.0),
        )
        for name, value in estimate.items()
    }
    assert more(made["lqg_frozen"]) == pytest.approx(-23.1)
    section = gust_alleviation(made, made["lqg"].changes, MODEL, 50, 267.0, 20, 0.05, 0.3)
    text = as_markdown("t", [section], Path())
    assert "2.6 % less reduction of the RBM rms than the base case (95 % interval -30.0 to +0.0 %)" in text
    assert "the paper says similar: agrees" in text
    assert "the paper says less than 5 % different: disagrees" in text
    # Fixed words explain what was seen on one case, and are not said of another.
    explained = "Homogeneous gusts leave the blades little to tell each other."
    assert explained not in text
    seen = replace(MODEL, inputs_hash=load_case("nrel5mw-rated").hash())
    section = gust_alleviation(made, made["lqg"].changes, seen, 50, 267.0, 20, 0.05, 0.3)
    assert explained in as_markdown("t", [section], Path())


def test_robustness_at_the_design_point_is_the_loops_own_rms(tmp_path):
    agent = lqg_agent("lqg", MODEL, Weights(3.0))
    heavy = {"heavy": replace(MODEL, turbine=with_effectiveness(MODEL.turbine, 50.0)), "same": MODEL}
    changes = sensitivity(agent, MODEL, heavy, Cache(tmp_path, "a"))
    expected = stationary_rms(MODEL, agent.system)["rbm"] / stationary_rms(MODEL)["rbm"] - 1.0
    for condition in ("flap x 1", "L 147 m", "delay 0"):
        assert changes[0, CONDITIONS.index(condition)] == pytest.approx(expected, rel=1e-9)
    assert changes[0, -1] == pytest.approx(expected, rel=1e-9)
    assert np.isnan(changes[0, -2])
    assert changes[4, -2] > 0.0
    weak, strong = (changes[0, CONDITIONS.index(f"flap x {factor}")] for factor in ("0.7", "1.3"))
    assert strong < expected < weak < 0.0


def test_margins_are_where_the_loop_begins_to_grow(tmp_path):
    agent = lqg_agent("lqg", MODEL, Weights(1e3, acceleration=1e-4))
    found = dict(zip(MARGINS, margins("lqg", agent.system, MODEL, Cache(tmp_path, "a")), strict=True))
    assert closed_loop(MODEL, agent.system, 0.99 * found["flap's effect up to"]).spectral_radius() < 1.0
    steps = round(found["delay up to [ms]"] / 7.0)
    for further, stable in ((0, True), (1, False)):
        late = late_measurement(agent.system, steps + further, MODEL.rotor_speed)
        assert (closed_loop(MODEL, late).spectral_radius() < 1.0) == stable


def test_a_loop_that_grows_as_it_is_has_no_margins_and_its_own_frequency(tmp_path):
    agent = lqg_agent("lqg", MODEL, Weights(30.0))
    strong = replace(MODEL, turbine=with_effectiveness(MODEL.turbine, 10.0))
    found = dict(zip(MARGINS, margins("lqg", agent.system, strong, Cache(tmp_path, "a")), strict=True))
    values = np.linalg.eigvals(closed_loop(strong, agent.system).A)
    frequency = abs(np.angle(values[np.abs(values).argmax()])) / (2.0 * np.pi * MODEL.time_step)
    for margin, least in (
        ("disk margin", 0),
        ("gain up to", 1),
        ("flap's effect up to", 0),
        ("delay up to [ms]", 0),
    ):
        assert found[margin] == least
    for name in ("at [Hz]", "more grows at [Hz]", "longer grows at [Hz]"):
        assert found[name] == pytest.approx(frequency)


def test_what_grows_and_what_has_no_bound_is_said():
    changes = np.tile([[-0.2], [-0.2], [0.04], [np.nan], [np.nan]], len(CONDITIONS) + 1)
    worse = changes.copy()
    worse[:, -1] = np.nan, np.nan, np.nan, 3.8, 47.0
    found = {"LQG": worse, "PD": changes}
    text = as_markdown(
        "t",
        [
            robustness(
                found,
                {},
                {"PD": np.array([1.0, 2.0, 3.0, 4.0, np.inf, np.nan, 7.0, 8.0])},
                ("heavy",),
                _sampled(MODEL, 0.02),
            )
        ],
        Path(),
    )
    assert "| heavy | grows: 3.8 Hz, doubles in 47 s | -20.0 / -20.0 / 2.29 |" in text
    assert "LQG grows under: heavy." in text
    assert "Stable under all of them: PD." in text
    assert "| PD | 1 | 2 | 3 | 4 | none |  | 7 | 8 |" in text
    assert "A delay of one step is 20 ms" in text
    assert "up to a delay of 1200 ms" in text


def test_a_model_of_other_inputs_than_the_case_is_refused(tmp_path):
    with pytest.raises(ValueError, match="built from other inputs"):
        Plants(MODEL, load_case("nrel5mw-rated"), Cache(tmp_path, "a"))


def test_the_roots_sway_has_the_hubs_velocity():
    model = load_model("nrel5mw-rated")
    wind = swaying_wind(model)
    rms = np.sqrt(np.diag(wind.C @ wind.stationary_covariance() @ wind.C.T))
    assert wind.outputs == ("wind", "hub_velocity", "hub_acceleration")
    assert rms[0] == pytest.approx(1.1, rel=1e-6)
    assert rms[1] == pytest.approx(2 * np.pi * 0.32 * stationary_rms(model)["tower_fore_aft"], rel=1e-6)


def test_a_lag_is_found_with_its_sign():
    signal = np.random.default_rng(0).standard_normal(4000).cumsum()
    signal -= signal.mean()
    assert _lag(signal[50:-50], signal[20:-80], 0.01) == pytest.approx(0.3)


def test_html_needs_no_other_file_and_escapes(tmp_path):
    figure = tmp_path / "figure.svg"
    figure.write_text("<svg/>")
    section = Section("a < b", ("one & two", Table(("x",), (("<1>",),)), figure))
    page = as_html("title", [section])
    assert "a &lt; b" in page
    assert "&lt;1&gt;" in page
    assert "data:image/svg+xml;base64,PHN2Zy8+" in page
    assert "![figure](figure.svg)" in as_markdown("title", [section], tmp_path)


def test_table_2_differs_where_the_paper_misprints_it(tmp_path):
    section = table_2(load_case("nrel5mw-rated"), Cache(tmp_path, "a"))
    rows = [row for table in section.content if isinstance(table, Table) for row in table.rows]
    assert len(rows) == 2 * 13
    errors = {cell.split("(")[1] for row in rows for cell in row[2:]}
    assert "+43.1)" in errors
    assert section.verdict.startswith("agrees: 112 of 117 entries")
    assert "misprint of 3.0e8" in " ".join(part for part in section.parts if isinstance(part, str))


def test_the_report_begins_with_the_verdicts():
    found = summary([Section("one", (), "agrees"), Section("two", ())])
    assert found.content[0].rows == (("one", "agrees"),)


def test_an_interrupt_keeps_what_is_finished_and_says_so(short, tmp_path, monkeypatch, capsys):
    def stop(_):
        raise KeyboardInterrupt

    monkeypatch.setitem(program.PARTS, "figure9", stop)
    assert program.main(["table2", "figure9", "--processes", "1", "--output", str(tmp_path)]) == 130
    assert "run it again" in capsys.readouterr().err
    assert [path.name.split("-")[0] for path in (tmp_path / "paper" / "parts").iterdir()] == ["table2"]


@pytest.mark.parametrize(("own", "words"), [(True, "the scored signals"), (False, "others")])
def test_a_reading_far_from_the_trial_is_said(own, words):
    changes = tuple(Estimate(value, value, value) for value in (-0.10, -0.20, -0.15))
    found = readings_section([Reading("scaled", own, 0.5, 1.7, changes, changes)], 50, 12, 0.77)
    assert f"tuned on {words}: at most 12.9 points" in found.conclusions[-1]
    assert "more than the rule of four allows" in found.conclusions[-1]
    assert "carry 0.77 of thin-aerofoil theory's lift" in found.content[0]


def test_a_section_of_duration_and_stops_tells_the_model_s_own():
    made = {
        "lqg": scores.Score(
            {key: Estimate(-0.2, -0.2, -0.2) for key in scores.CHANGES},
            0.1,
            0.1,
            1.0,
            0.1,
            Estimate(0.0, 0.0, 0.0),
        )
    }
    model = replace(
        MODEL, length_scale=220.0, flaps=(replace(MODEL.flaps[0], angle_limit=0.1, rate_limit=0.5),)
    )
    section = gust_alleviation(made, made["lqg"].changes, model, 2, 20.0, 12, 0.05, 0.3)
    assert "2 realisations of 20 s (1 L/U)" in section.content[0]
    assert (
        f"{np.rad2deg(0.1):g} deg or {np.rad2deg(0.5):g} deg/s on 12 other realisations" in section.content[0]
    )


def test_a_trial_run_says_so_on_every_page_concludes_nothing_and_leaves_the_full_report(
    short, tmp_path, capsys
):
    for name in ("paper.md", "paper.html"):
        (tmp_path / name).write_text("the full report")
    (tmp_path / "paper").mkdir()
    (tmp_path / "paper" / "figure15.svg").write_text("the full figure")
    assert program.main(["table1", "gust_alleviation", "figure15", "--quick", "--output", str(tmp_path)]) == 0
    notice = "Trial run: 2 realisations of 4 s in place of 50 of 267 s"
    assert notice in capsys.readouterr().out
    assert (tmp_path / "paper.md").read_text() == (tmp_path / "paper.html").read_text() == "the full report"
    assert (tmp_path / "paper" / "figure15.svg").read_text() == "the full figure"
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "paper",
        "paper-trial",
        "paper-trial.html",
        "paper-trial.md",
        "paper.html",
        "paper.md",
    ]
    text = (tmp_path / "paper-trial.md").read_text()
    title, *sections = text.split("\n## ")
    assert title.startswith("# Trial run: ")
    assert sections[0].startswith("Case\n")
    assert all(section.splitlines()[2].startswith(notice) for section in sections)
    assert "(0.299 L/U)" in text
    assert "(20 L/U)" not in text
    assert "agree" not in text
    assert "as in the paper" not in text
    page = (tmp_path / "paper-trial.html").read_text()
    # What is fixed is repeated on each printed page.
    assert '<p class="watermark">Trial run</p>' in page
    assert ".watermark { position: fixed" in page
    assert page.count(f"<p>{notice}") == len(sections)


def test_a_report_of_some_parts_leaves_the_full_one(tmp_path):
    (tmp_path / "paper.md").write_text("the full report")
    assert program.main(["table2", "--output", str(tmp_path)]) == 0
    assert (tmp_path / "paper.md").read_text() == "the full report"
    text = (tmp_path / "paper-part.md").read_text()
    assert f"Parts of the report: table2; 1 of {len(program.PARTS)}." in text
    assert "Trial run" not in text


def test_another_turbine_is_not_set_beside_the_paper_s(tmp_path, capsys):
    case = small_case(2.0, "large").to_dict()
    save_model(replace(MODEL, name="large", case=case), tmp_path / "large.safetensors")
    arguments = ["--quick", "--model", str(tmp_path / "large.safetensors"), "--output", str(tmp_path)]
    assert program.main(["table1", *arguments]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith(
        "baselines.paper: turbine: expected nrel5mw, got scaled15mw, which differs in rotor, "
    )


def test_the_study_s_case_is_the_one_the_model_holds_whatever_its_name(tmp_path):
    case = replace(load_case(), name="slow")
    slow = replace(MODEL, case=case.to_dict(), name="slow", inputs_hash=case.hash())
    assert program.Study(slow, tmp_path, 2, True, print).case.hash() == case.hash()
    older = replace(slow, case={key: value for key, value in slow.case.items() if key != "airloads"})
    with pytest.raises(
        ValueError, match="model slow: airloads: missing; .*in the case it holds; build it again"
    ):
        program.Study(older, tmp_path, 2, True, print)


def _turbine_responses():
    """Made up: what is tested is what is said of them."""
    frequency = np.geomspace(0.1, 10.0, 40)
    flat = np.ones((6, 40), dtype=complex) * np.linspace(1.0, 2.0, 6)[:, None]
    names = np.array([RIGID, OWN, SOFT, f"{OWN}, blade 2", f"{OWN}, blade 3", PARKED])
    towers = Curves(names, frequency, flat)
    turns = np.linspace(*CYCLES, 50)
    tips = Tips(turns, np.sin(turns), np.outer(np.sin(turns), [1.0, 1.1, 0.9]), np.array([0.7, 0.1]))
    return turbine_sections.Responses(towers, tips, towers, towers)


def test_figures_of_the_turbine_are_judged_for_the_case_that_was_looked_at_alone(tmp_path):
    own = load_case("nrel5mw-rated")
    other = replace(own, flaps=(replace(own.flaps[0], span_start=0.5),))
    model = replace(MODEL, case=own.to_dict())
    ours, theirs = (
        turbine_sections.turbine_figures(_turbine_responses(), case, model, tmp_path) for case in (own, other)
    )
    assert ours.verdict.startswith("agree")
    assert (tmp_path / "figure10.svg").stat().st_size > 10_000
    assert theirs.verdict == ""
    assert theirs.conclusions == (
        "Not judged: only the figures of nrel5mw-rated were looked at beside the paper's.",
    )


def test_jobs_of_a_stage_are_done_in_processes_of_their_own_and_their_numbers_found(tmp_path):
    jobs = [Job("table2"), Job("figure15")]
    given = load_model("nrel5mw-rated"), tmp_path, 2, True
    assert set(worked(jobs, 2, *given)) == set(jobs)
    study = program.Study(*given, lambda what: None)
    kept = {path.name for path in (tmp_path / "parts").iterdir()}
    assert {name.split("-")[0] for name in kept} == {"table2", "figure15"}
    assert study.table2().verdict.startswith("agrees")
    assert "revolutions" in study.figure15().content[0]
    assert {path.name for path in (tmp_path / "parts").iterdir()} == kept


def test_every_part_s_numbers_are_left_by_jobs_before_it(tmp_path):
    study = program.Study(load_model("nrel5mw-rated"), tmp_path, 2, False, lambda what: None)
    jobs = [job for stage in stages(study, program.PARTS) for job in stage]
    assert len(set(jobs)) == len(jobs)
    assert all(callable(getattr(program.Study, job.method)) for job in jobs)
    scored = [name for job in jobs if job.method == "scored_together" for name in job.arguments]
    assert sorted(scored) == sorted((*study.names, *study_module.BESIDE, "open_loop"))
    assert {job.arguments[0] for job in jobs if job.method == "judged"} == set(study.linear)
