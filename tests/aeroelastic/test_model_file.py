"""Model files: faithful, atomic, and named when something is wrong with them."""

from dataclasses import replace

import numpy as np
import pytest
import safetensors.numpy

from flapgym.aeroelastic import builtin_models, load_model, save_model
from flapgym.aeroelastic.record import readings
from flapgym.turbine import load_case


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

    monkeypatch.setattr("flapgym.atomic.os.replace", fail)
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
