"""Files: what is read, what is written, and what models, agents, cases and recordings must hold to."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy

from benchmarks.errors.entry import Entry, Section, command
from benchmarks.fuzz.kinds import policy, sealed, small_model
from flapgym.control import load_agent, save_agent
from flapgym.core.atomic import write_atomically
from flapgym.model import load_model, save_model
from flapgym.turbine import load_case
from flapgym.wind.recording import read_wind


def _case(text: str) -> Callable[[], object]:
    """Read a case that differs from the shipped one by a text."""

    def give() -> object:
        Path("mine.toml").write_text(f'base = "nrel5mw-rated"\nname = "mine"\n{text}', encoding="utf-8")
        return load_case("mine.toml")

    return give


def _bytes(content: bytes, read: Callable[[str], object], name: str = "mine.toml") -> Callable[[], object]:
    def give() -> object:
        Path(name).write_bytes(content)
        return read(name)

    return give


def _pipe() -> object:
    os.mkfifo("pipe")
    return load_case("pipe")


def _large() -> object:
    with open("mine.toml", "wb") as file:
        file.truncate(1 << 34)
    return load_case("mine.toml")


def _wind(text: str) -> Callable[[], object]:
    return _bytes(text.encode(), read_wind, "mast.csv")


def _agent(**changes: Any) -> Callable[[], object]:
    """Read a sealed agent's file with other entries."""

    def give() -> object:
        model = small_model()
        save_agent("mine.json", policy(), model, "An example.", {})
        content = json.loads(Path("mine.json").read_text(encoding="utf-8")) | changes
        rest = {key: value for key, value in content.items() if key != "checksum"}
        content["checksum"] = hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()
        Path("mine.json").write_text(json.dumps(content), encoding="utf-8")
        return load_agent("mine.json", model)

    return give


def _edited_agent() -> object:
    model = small_model()
    save_agent("mine.json", policy(), model, "An example.", {})
    path = Path("mine.json")
    path.write_text(path.read_text(encoding="utf-8").replace("example", "exempla", 1), encoding="utf-8")
    return load_agent("mine.json", model)


def _model(change: Callable[[dict[str, Any], dict[str, Any]], None]) -> Callable[[], object]:
    """Read a sealed model whose header or matrices were changed."""

    def give() -> object:
        save_model(small_model(), "mine.safetensors")
        tensors = safetensors.numpy.load(Path("mine.safetensors").read_bytes())
        with safetensors.safe_open("mine.safetensors", framework="numpy") as file:
            header = json.loads(file.metadata()["flapgym"])
        header.pop("checksum")
        change(header, tensors)
        header["checksum"] = sealed(header, tensors)
        metadata = {"flapgym": json.dumps(header)}
        Path("mine.safetensors").write_bytes(safetensors.numpy.save(tensors, metadata))
        return load_model("mine.safetensors")

    return give


def _damaged_model() -> object:
    save_model(small_model(), "mine.safetensors")
    content = bytearray(Path("mine.safetensors").read_bytes())
    content[-1] ^= 1
    Path("mine.safetensors").write_bytes(content)
    return load_model("mine.safetensors")


def _set(name: str, value: Any) -> Callable[[], object]:
    return _model(lambda header, tensors: header.update({name: value}))


def _folder_for_a_result() -> str:
    Path("results/compare.json").mkdir(parents=True)
    return command("compare", "--agents", "pd", "--output", "results")


def _write_to_a_pipe() -> None:
    os.mkfifo("pipe")
    write_atomically("pipe", b"")


def _read_json_agent(name: str) -> object:
    return load_agent(name, small_model())


FILES = (
    Section(
        "Whatever is read",
        (
            Entry("a case that is a pipe", _pipe),
            Entry("a case that is a device", lambda: load_case("/dev/zero")),
            Entry("a case that is a folder", lambda: load_case(".")),
            Entry("a case that is not there", lambda: load_case("nrel5mw-rates")),
            Entry("a case of 16 GB", _large),
            Entry("a case in UTF-16", _bytes('name = "a"\n'.encode("utf-16"), load_case)),
            Entry("a case in Latin-1", _bytes('# Höhe\nname = "a"\n'.encode("latin-1"), load_case)),
            Entry("TOML of 40 brackets", _case("a = " + 40 * "[" + 40 * "]")),
            Entry("TOML of 100 000 brackets", _case("a = " + 100_000 * "[")),
            Entry("TOML with a key of 1000 parts", _case("a." * 1000 + "a = 1")),
            Entry("TOML with an integer of 400 digits", _case("[reduction]\nblade_modes = " + 400 * "9")),
            Entry("an agent that is `[]`", _bytes(b"[]", _read_json_agent, "mine.json")),
            Entry("an agent that is `null`", _bytes(b"null", _read_json_agent, "mine.json")),
            Entry("an agent with NaN", _bytes(b'{"a": NaN}', _read_json_agent, "mine.json")),
            Entry("an agent with a key twice", _bytes(b'{"a": 1, "a": 2}', _read_json_agent, "mine.json")),
            Entry("half of a character", _bytes(b'{"a": "\\ud800"}', _read_json_agent, "mine.json")),
        ),
    ),
    Section(
        "Cases",
        (
            Entry("a key of another name", _case('[flap]\nangel_limit = "10 deg"')),
            Entry("a number without its unit", _case("[flap]\nangle_limit = 10")),
            Entry("another dimension", _case('[flap]\nangle_limit = "10 m"')),
            Entry("a value out of range", _case('[flap]\nangle_limit = "0 deg"')),
            Entry("`true` for a count", _case("[reduction]\nblade_modes = true")),
            Entry("a list for a count", _case("[reduction]\nblade_modes = [5]")),
            Entry("NaN", _case("[flap]\nspan_start = nan")),
            Entry(
                "a name with an escape", _bytes(b'base = "nrel5mw-rated"\nname = "\\u001b[31m"', load_case)
            ),
            Entry("no base and no turbine", _bytes(b'name = "mine"', load_case)),
            Entry("a base that is itself", _bytes(b'base = "mine.toml"', load_case)),
        ),
    ),
    Section(
        "Models",
        (
            Entry("a name that is none", lambda: load_model("nrel5mw-ratde")),
            Entry("a case in its place", _bytes(b"", load_model)),
            Entry("a text file", _bytes(b"not a model", load_model, "mine.safetensors")),
            Entry("a flipped bit", _damaged_model),
            Entry("a sealed wind speed as text", _set("wind_speed", "11")),
            Entry("a sealed limit below zero", _set("flap_rate_limit", -1.0)),
            Entry("a sealed rms of zero", _set("rbm_rms", 0)),
            Entry("an unknown entry", _set("colour", "red")),
            Entry("an unstable turbine", _model(lambda h, t: t.update({"turbine.A": 1.2 * t["turbine.A"]}))),
            Entry("NaN in a matrix", _model(lambda h, t: t.update({"blade.B": np.nan * t["blade.B"]}))),
            Entry("a misshapen matrix", _model(lambda h, t: t.update({"blade.C": t["blade.C"][:1]}))),
            Entry("half of a periodic part", _model(lambda h, t: t.update({"periodic.left": np.eye(3)}))),
        ),
    ),
    Section(
        "Agents",
        (
            Entry("a name that is none", lambda: load_agent("lgq", small_model())),
            Entry("an edited file", _edited_agent),
            Entry("an older format", _agent(format_version=1)),
            Entry("actions held for 101 steps", _agent(steps_per_action=101)),
            Entry("actions held for 2.0 steps", _agent(steps_per_action=2.0)),
            Entry("actions held for `true` steps", _agent(steps_per_action=True)),
            Entry("an unknown observation", _agent(observe=["rbm", "weather"])),
            Entry("an observation twice", _agent(observe=["rbm", "rbm"])),
            Entry("a layer that does not fit", _agent(weights=[[[1.0]], [[1.0]]])),
            Entry("no name", _agent(name="")),
            Entry("open loop's name", _agent(name="open_loop")),
            Entry("a name with a line break", _agent(name="a\nb")),
            Entry("a name that is a formula", _agent(name="=cmd()")),
            Entry("a name with an escape", _agent(name="\x1b[31mred")),
            Entry(
                "an object in `design`",
                lambda: save_agent(
                    "mine.json", policy(), small_model(), "An example.", {"optimiser": object()}
                ),
            ),
        ),
    ),
    Section(
        "Recordings",
        (
            Entry("no header", _wind("0, 11\n1, 12\n")),
            Entry("a unit that is none", _wind("time [s], wind [mph]\n0, 11\n1, 12\n")),
            Entry("one sample", _wind("time [s], wind [m/s]\n0, 11\n")),
            Entry("times that fall", _wind("time [s], wind [m/s]\n1, 11\n0, 12\n")),
            Entry("a gap", _wind("time [s], wind [m/s]\n0, 11\n1, NaN\n")),
            Entry("decimal commas between commas", _wind("time [s], wind [m/s]\n0,0, 11\n0,5, 12\n")),
            Entry("decimal points and commas", _wind("time [s]; wind [m/s]\n0; 1,100\n0.5; 12\n")),
            Entry("another kind of date", _wind("time, wind [m/s]\n31.01.2024 13:00, 11\n")),
            Entry(
                "a time zone here and there",
                _wind("time, wind [m/s]\n2024-01-31T13:00, 1\n2024-01-31T14:00Z, 1\n"),
            ),
        ),
    ),
    Section(
        "Whatever is written",
        (
            Entry("a model to a device", lambda: command("build", "nrel5mw-rated", "--output", "/dev/null")),
            Entry("a model to a folder", lambda: command("build", "nrel5mw-rated", "--output", ".")),
            Entry(
                "a model to no folder",
                lambda: command("build", "nrel5mw-rated", "--output", "no/m.safetensors"),
            ),
            Entry("a result where a folder is", _folder_for_a_result),
            Entry("anything to a pipe", _write_to_a_pipe),
        ),
    ),
)
