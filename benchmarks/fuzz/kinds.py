"""The kinds of files, with sound examples, how one is loaded, and what must hold of what was taken."""

from __future__ import annotations

import hashlib
import json
import struct
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy

from benchmarks.fuzz.mutations import Random, as_json, spoilt, spoilt_array, spoilt_entries
from flapgym.cli import describe
from flapgym.control import Policy, load_agent, save_agent
from flapgym.core.state_space import StateSpace
from flapgym.envs import FlapEnv
from flapgym.model import DEFAULT_MODEL, TurbineModel, load_model, save_model
from flapgym.model.harmonics import PeriodicPart
from flapgym.turbine import Case, load_case
from flapgym.wind.recording import WindSeries, read_wind

RECORDINGS = (
    "time [s], wind [m/s]\n0.0, 11.3\n0.5, 11.1\n1.0, 10.9\n",
    "# mast\ntime [s]; wind_perturbation [km/h]\n0,0; 1,5\n0,5; -2\n2; 3,25\n",
    "time; wind [m/s]\n2024-01-31 23:59:59,5; 11,5\n2024-02-01 00:00:00,0; 12\n2024-02-01 00:00:01,5; 9,25\n",
    "wind [kn]\ttime [min]\r\n20\t0\r\n21.5\t0.1\r\n",
)


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes
    ----------
    name, suffix : str
    examples : tuple of bytes
        Sound files.
    load : callable
        Of a path; raises ValueError or OSError.
    check : callable
        Fails unless what was loaded is finite and shaped.
    spoil : callable
        Of an example: one that is not sound any more, or still is.
    """

    name: str
    suffix: str
    examples: tuple[bytes, ...]
    load: Callable[[Path], Any]
    check: Callable[[Any], None]
    spoil: Callable[[bytes, Random], bytes]


def kinds(folder: Path) -> tuple[Kind, ...]:
    """All kinds; their examples are written to a folder first."""
    model = small_model()
    models = []
    for name, each in (("plain", model), ("periodic", with_periodic_part(model))):
        save_model(each, folder / f"{name}.safetensors")
        models.append((folder / f"{name}.safetensors").read_bytes())
    save_agent(folder / "policy.json", policy(), model, "An example.", {"seed": 1})
    shipped = Path(str(resources.files("flapgym.control") / "agents" / DEFAULT_MODEL))
    agents = [
        path.read_bytes()
        for path in (folder / "policy.json", *(shipped / f"{n}.json" for n in ("pd", "pid")))
    ]
    data = Path(str(resources.files("flapgym.turbine") / "data"))
    derived = (
        b'base = "nrel5mw-rated"\nname = "mine"\n[flap]\nrate_limit = "20 deg/s"\n[blades]\npitch_offset = '
    )
    cases = [(data / "nrel5mw-rated.toml").read_bytes(), derived + b'["0 deg", "0.5 deg", "0 deg"]\n']
    return (
        Kind("model", ".safetensors", tuple(models), load_model, check_model, spoilt_model),
        Kind(
            "agent", ".json", tuple(agents), lambda path: load_agent(path, model), check_agent, spoilt_agent
        ),
        Kind("case", ".toml", tuple(cases), load_case, check_case, spoilt),
        Kind("recording", ".csv", tuple(map(str.encode, RECORDINGS)), read_wind, check_recording, spoilt),
    )


def small_model() -> TurbineModel:
    """The shipped model with few states, so that thousands are read in a minute."""
    model, random = load_model(), np.random.default_rng(0)

    def small(system: StateSpace, order: int) -> StateSpace:
        return replace(
            system,
            A=0.9 * np.linalg.qr(random.standard_normal((order, order)))[0],
            B=random.standard_normal((order, len(system.inputs))),
            C=1e5 * random.standard_normal((len(system.outputs), order)),
        )

    return replace(model, turbine=small(model.turbine, 6), blade=small(model.blade, 3))


def with_periodic_part(model: TurbineModel) -> TurbineModel:
    """The same of unequal blades."""
    turbine, random = model.turbine, np.random.default_rng(1)
    rows, columns = turbine.order + len(turbine.outputs), turbine.order + len(turbine.inputs)
    part = PeriodicPart(
        left=1e-3 * random.standard_normal((rows, 2)),
        core=random.standard_normal((3, 2, 2)).astype(np.complex128),
        right=1e-3 * random.standard_normal((2, columns)),
        forcing=1e-3 * random.standard_normal((4, rows)).astype(np.complex128),
    )
    return replace(model, periodic=part)


def policy() -> Policy:
    """A small network."""
    random = np.random.default_rng(2)
    return Policy(
        name="example",
        observe=("rbm", "flap_angle"),
        steps_per_action=5,
        per_blade=True,
        offset=np.zeros(2),
        scale=np.ones(2),
        weights=(random.standard_normal((3, 2)), random.standard_normal((1, 3))),
        biases=(np.zeros(3), np.zeros(1)),
        activation="tanh",
        squash="clip",
    )


def spoilt_agent(content: bytes, random: Random) -> bytes:
    """Bytes changed, or entries changed and sealed as save_agent seals them."""
    if random.random() < 0.4:
        return spoilt(content, random)
    document = spoilt_entries(json.loads(content), random)
    rest = {key: value for key, value in document.items() if key != "checksum"}
    if "checksum" in document and random.random() < 0.95:
        document["checksum"] = hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()
    return as_json(document)


def spoilt_model(content: bytes, random: Random) -> bytes:
    """Bytes changed, or entries and matrices changed and sealed as save_model seals them."""
    chance = random.random()
    if chance < 0.3:
        return spoilt(content, random)
    (size,) = struct.unpack("<Q", content[:8])
    header = json.loads(json.loads(content[8 : 8 + size])["__metadata__"]["flapgym"])
    tensors = safetensors.numpy.load(content)
    if chance < 0.7:
        header = spoilt_entries(header, random)
    if chance > 0.6:
        name = sorted(tensors)[random.integers(len(tensors))]
        if random.random() < 0.1:
            del tensors[name]
        else:
            tensors[name] = spoilt_array(tensors[name], random)
    if random.random() < 0.95:
        header.pop("checksum", None)
        header["checksum"] = sealed(header, tensors)
    return safetensors.numpy.save(tensors, {"flapgym": json.dumps(header, sort_keys=True)})


def sealed(header: Mapping[str, Any], tensors: Mapping[str, np.ndarray[Any, Any]]) -> str:
    """The checksum of a model file, as one who knows the format seals it."""
    digest = hashlib.sha256(json.dumps(header, sort_keys=True).encode())
    for key in sorted(tensors):
        digest.update(key.encode() + str(tensors[key].shape).encode())
        digest.update(np.ascontiguousarray(tensors[key], dtype="<f8").tobytes())
    return digest.hexdigest()


def check_model(model: TurbineModel) -> None:
    """A stable turbine with finite numbers, of which `flapgym info` has something to say and that steps."""
    for system in (model.turbine, model.blade):
        assert all(np.isfinite(getattr(system, key)).all() for key in "ABCD")
        assert np.abs(np.linalg.eigvals(system.A)).max() < 1.0
    numbers = [getattr(model, f.name) for f in fields(model) if f.type == "float"]
    assert all(type(number) in (int, float) and 0.0 < number < np.inf for number in numbers)
    assert len(describe(model).splitlines()) >= 10
    _step(model)


def _step(model: TurbineModel) -> None:
    """One action of the environment, unless its own door refuses the model; scipy warns of matrices of denormals."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            env = FlapEnv(model=model, backend="numpy", duration=50 * model.time_step)
        except ValueError:
            return
        env.reset(seed=0)
        observation = env.step(np.zeros(3, dtype=np.float32))[0]
    assert observation.shape == (3,)
    assert np.isfinite(observation).all()


def check_agent(agent: Any) -> None:
    """Finite numbers, a sound header, and three actions."""
    assert isinstance(agent.name, str)
    assert agent.name.isprintable()
    assert 0 < len(agent.name) <= 60
    assert type(agent.steps_per_action) is int
    assert 1 <= agent.steps_per_action <= 100
    assert len(set(agent.observe)) == len(agent.observe) > 0
    if isinstance(agent, Policy):
        arrays = [agent.offset, agent.scale, *agent.weights, *agent.biases]
    else:
        arrays = [agent.start, *(getattr(agent.system, key) for key in "ABCD")]
    assert all(array.dtype == np.float64 and np.isfinite(array).all() for array in arrays)
    entries = sum(2 if name == "azimuth" else 3 for name in agent.observe)
    with np.errstate(over="ignore", invalid="ignore"):  # finite numbers may have an infinite product
        assert agent.predict(np.zeros(entries, dtype=np.float32))[0].shape == (3,)


def check_case(case: Case) -> None:
    """Finite numbers in every place, and a hash of them."""
    assert len(case.hash()) == 64
    assert case.name.isprintable()
    waiting: list[Any] = [case.to_dict()]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict | list | tuple):
            waiting += value.values() if isinstance(value, dict) else value
        else:
            assert isinstance(value, str | int) or np.isfinite(value)


def check_recording(series: WindSeries) -> None:
    """Finite samples at times that increase."""
    assert series.time.shape == series.wind.shape
    assert series.time.size >= 2
    assert np.isfinite(series.time).all()
    assert np.isfinite(series.wind).all()
    assert (np.diff(series.time) > 0.0).all()
