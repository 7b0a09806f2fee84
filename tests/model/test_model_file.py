"""Model files: faithful, atomic, and named when something is wrong with them."""

import json
import os
from dataclasses import replace

import numpy as np
import pytest
import safetensors
import safetensors.numpy

from flapgym.model import builtin_models, load_model, save_model
from flapgym.model.record import readings
from flapgym.model.turbine_model import _checksum
from flapgym.turbine import load_case
from tests.synthetic import synthetic_model


def test_saved_model_is_loaded_as_it_was(tmp_path):
    model = load_model("nrel5mw-rated")
    save_model(model, tmp_path / "model.safetensors")
    again = load_model(tmp_path / "model.safetensors")
    for name in ("A", "B", "C", "D"):
        np.testing.assert_array_equal(getattr(again.turbine, name), getattr(model.turbine, name))
        np.testing.assert_array_equal(getattr(again.blade, name), getattr(model.blade, name))
    assert (again.hash, again.rbm_rms, again.turbine.inputs) == (
        model.hash,
        model.rbm_rms,
        model.turbine.inputs,
    )


@pytest.mark.parametrize("factor", [0.0, 1.02])
def test_hash_of_unequal_blades_knows_how_they_shake_the_turbine(factor):
    model = load_model("nrel5mw-heavy-blade")
    assert model.periodic is not None
    other = replace(model, periodic=replace(model.periodic, forcing=factor * model.periodic.forcing))
    assert other.hash != model.hash


def test_unknown_name_lists_the_shipped_models():
    with pytest.raises(FileNotFoundError, match="nrel5mw-rated"):
        load_model("nrel5mw-ratde")


def test_a_case_given_for_a_model_is_told_how_it_becomes_one(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('base = "nrel5mw-rated"\n')
    with pytest.raises(ValueError, match=r"flapgym build .*mine\.toml --output"):
        load_model(path)


def test_a_model_saved_where_no_folder_is_names_the_folder(tmp_path):
    with pytest.raises(FileNotFoundError, match="no folder .*nowhere; make it first"):
        save_model(load_model("nrel5mw-rated"), tmp_path / "nowhere" / "model.safetensors")


@pytest.mark.parametrize("cut", [0, 10, 5000])
def test_truncated_file_is_named_as_damaged(tmp_path, cut):
    path = tmp_path / "cut.safetensors"
    save_model(load_model("nrel5mw-rated"), path)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(ValueError, match="damaged or not a model file"):
        load_model(path)


def test_changed_matrix_is_named_as_damaged(tmp_path):
    path = tmp_path / "flipped.safetensors"
    save_model(load_model("nrel5mw-rated"), path)
    content = bytearray(path.read_bytes())
    content[-3] ^= 0x10
    path.write_bytes(content)
    with pytest.raises(ValueError, match="damaged, its content does not match"):
        load_model(path)


def test_changed_header_is_named_as_damaged(tmp_path):
    path = tmp_path / "header.safetensors"
    save_model(load_model("nrel5mw-rated"), path)
    content = path.read_bytes()
    assert content.count(b'\\"wind_speed\\": 11.0') >= 1
    path.write_bytes(content.replace(b'\\"wind_speed\\": 11.0', b'\\"wind_speed\\": 17.0'))
    with pytest.raises(ValueError, match="damaged, its content does not match"):
        load_model(path)


def test_other_safetensors_file_is_no_model(tmp_path):
    path = tmp_path / "other.safetensors"
    safetensors.numpy.save_file({"a": np.zeros(3)}, path)
    with pytest.raises(ValueError, match="not a flapgym model file"):
        load_model(path)


def test_other_format_version_is_refused(tmp_path):
    path = tmp_path / "future.safetensors"
    save_model(replace(load_model("nrel5mw-rated"), format_version=99), path)
    with pytest.raises(ValueError, match="format version 99"):
        load_model(path)


def test_failed_write_leaves_the_old_file_and_no_other(tmp_path, monkeypatch):
    path = tmp_path / "model.safetensors"
    path.write_text("old")

    def fail(*args, **kwargs):
        raise OSError("disk full")

    monkeypatch.setattr("flapgym.core.atomic.os.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        save_model(load_model("nrel5mw-rated"), path)
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["model.safetensors"]


@pytest.mark.parametrize("name", builtin_models())
def test_shipped_models_tell_the_readings_and_the_flutter_of_the_code_beside_them(name):
    record = load_model(name).record
    assert record.readings == readings(load_case(name))
    assert record.flutter is not None


def test_shipped_models_are_found_by_name():
    assert "nrel5mw-rated" in builtin_models()


def resealed(path, header=(), tensors=()):
    """Change entries (dotted; ... takes one out) and tensors of a file and seal it anew, as one who knows how would."""
    with safetensors.safe_open(path, framework="numpy") as file:
        content = json.loads(file.metadata()["flapgym"])
        arrays = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
    for given, kept in ((dict(header), content), (dict(tensors), arrays)):
        for name, value in given.items():
            table = kept
            *way, last = name.split(".") if kept is content else [name]
            for step in way:
                table = table[step]
            if value is ...:
                del table[last]
            else:
                table[last] = value(table[last]) if callable(value) else value
    del content["checksum"]
    content["checksum"] = _checksum(arrays, content)
    path.write_bytes(safetensors.numpy.save(arrays, {"flapgym": json.dumps(content, sort_keys=True)}))


def refused(path, message):
    with pytest.raises(ValueError) as caught:
        load_model(path)
    assert str(caught.value).startswith(f"model {path}: ")
    assert message in str(caught.value)
    assert str(caught.value).isprintable()
    return True


NUMBERS = (
    "wind_speed",
    "rotor_speed",
    "flap_angle_limit",
    "flap_rate_limit",
    "acceleration_limit",
    "rbm_rms",
)


@pytest.mark.parametrize("name", [*NUMBERS, "turbulence_intensity", "length_scale", "time_step"])
@pytest.mark.parametrize("value", ["11", -1.0, 0, True, None, [1.0], 1e400])
def test_a_sealed_model_with_no_positive_number_where_one_is_meant_is_refused(tmp_path, name, value):
    path = tmp_path / "model.safetensors"
    save_model(synthetic_model(), path)
    if value == 1e400:
        resealed(path, {name: float("nan")})
        assert refused(path, "damaged header: not valid JSON: expected finite numbers, got NaN")
    else:
        resealed(path, {name: value})
        assert refused(path, f"{name}: expected a number from ")


@pytest.mark.parametrize(
    "header, tensors, message",
    [
        ({"name": 1}, {}, "name: expected a text of one line, got 1"),
        ({"name": "a\n\x1b[31m"}, {}, "name: expected a text of one line"),
        ({"inputs_hash": None}, {}, "inputs_hash: expected a text"),
        ({"case": []}, {}, "case: expected a mapping, got []"),
        ({"record": None}, {}, "record: expected a mapping"),
        ({"turbine": 1}, {}, "turbine: expected a mapping"),
        ({"record.tools": {"numpy": 1}}, {}, "record.tools.numpy: expected a text"),
        ({"record.readings": "all"}, {}, "record.readings: expected a list"),
        ({"record.errors": {"x": "small"}}, {}, "record.errors.x: expected a number from 0"),
        (
            {"record.flutter": {"searched": "far", "speed": None, "frequency": None}},
            {},
            "record.flutter.searched: expected a number",
        ),
        ({"record.flutter": {"speed": 1.0}}, {}, "record.flutter: expected the entries searched, speed"),
        (
            {"record.flutter": {"searched": 1.0, "speed": 1.0, "frequency": None}},
            {},
            "record.flutter.frequency: expected",
        ),
        ({"turbine.inputs": ["a"]}, {}, "turbine.B: expected shape"),
        ({"turbine.inputs": lambda names: names[::-1]}, {}, "turbine.inputs: expected flap_angle_0"),
        ({"blade.outputs": "rbm"}, {}, "blade.outputs: expected a list"),
        ({"blade": ...}, {}, "'blade': missing"),
        ({"rbm_rms": ...}, {}, "'rbm_rms': missing"),
        ({"colour": "red"}, {}, "'colour': unknown entry"),
        (
            {},
            {"turbine.A": lambda A: 1.2 * A},
            "turbine.A: expected a stable system, of a spectral radius below 1",
        ),
        ({}, {"blade.A": lambda A: 1.2 * A}, "blade.A: expected a stable system"),
        ({}, {"turbine.A": lambda A: A[:-1]}, "turbine.A: expected"),
        ({}, {"turbine.A": lambda A: A * np.nan}, "'turbine.A': expected finite numbers below 1e+30"),
        (
            {},
            {"turbine.A": lambda A: A.astype(np.float32)},
            "'turbine.A': expected numbers in double precision",
        ),
        ({}, {"turbine.A": lambda A: A.ravel()}, "turbine.A: expected"),
        ({}, {"turbine.A": ...}, "'turbine.A': missing"),
        ({}, {"spare": np.zeros(3)}, "'spare': unknown matrix"),
        ({}, {"periodic.left": np.zeros((21, 1))}, "'periodic.right': missing"),
    ],
)
def test_a_sealed_model_of_nonsense_is_refused_by_its_entry(tmp_path, header, tensors, message):
    path = tmp_path / "model.safetensors"
    save_model(synthetic_model(), path)
    resealed(path, header, tensors)
    assert refused(path, message)


@pytest.mark.parametrize(
    "name, change",
    [
        ("left", lambda left: left[:-1]),
        ("right", lambda right: right[:, :-1]),
        ("core", lambda core: core[:, :, :-1]),
        ("core", lambda core: core[0]),
        ("forcing", lambda forcing: forcing[:, :-1]),
        ("forcing", lambda forcing: forcing[:1]),
        ("left", lambda left: left.ravel()),
    ],
)
def test_a_sealed_periodic_part_that_does_not_fit_is_refused(tmp_path, name, change):
    path = tmp_path / "model.safetensors"
    save_model(load_model("nrel5mw-heavy-blade"), path)
    resealed(path, {}, {f"periodic.{name}": change})
    assert refused(path, "periodic")


def test_an_unstable_model_is_not_saved(tmp_path):
    model = synthetic_model()
    unstable = replace(model, turbine=replace(model.turbine, A=1.2 * model.turbine.A))
    with pytest.raises(ValueError, match="model synthetic: turbine.A: expected a stable system"):
        save_model(unstable, tmp_path / "model.safetensors")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("path, kind", [("/dev/zero", "a device"), ("pipe", "a pipe"), (".", "a folder")])
def test_a_model_is_a_regular_file(tmp_path, path, kind):
    if path == "pipe":
        path = tmp_path / "pipe"
        os.mkfifo(path)
    with pytest.raises(ValueError, match=f"model .*: expected a regular file, got {kind}"):
        load_model(path)
