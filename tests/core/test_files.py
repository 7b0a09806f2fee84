"""What is read and written: regular files of text in UTF-8 and bounded size, whole or not at all."""

import json
import multiprocessing
import os
import re
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from flapgym.core.atomic import check_target, write_atomically, write_picture, write_together
from flapgym.core.files import LARGEST_SETTINGS, parse_json, read_bytes, read_text, read_toml, regular_file

ROOT = Path(__file__).parents[2]
TEXT = 'base = "größer"\n'


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_utf_8_is_read_with_and_without_its_mark(tmp_path, encoding):
    path = tmp_path / "a.toml"
    path.write_bytes(TEXT.encode(encoding))
    assert read_toml(path) == {"base": "größer"}


@pytest.mark.parametrize(
    "encoding, named",
    [
        ("utf-16", "UTF-16"),
        ("utf-16-le", "UTF-16"),
        ("utf-16-be", "UTF-16"),
        ("utf-32", "UTF-32"),
        ("latin-1", "Latin-1 or Windows-1252"),
    ],
)
def test_another_encoding_is_named(tmp_path, encoding, named):
    path = tmp_path / "a.txt"
    path.write_bytes(f"first\n{TEXT}".encode(encoding))
    with pytest.raises(
        ValueError, match=rf"a\.txt: expected text in UTF-8, got .*{named}.*; save it as UTF-8"
    ):
        read_text(path, 1000)


def test_what_is_no_regular_file_is_refused_before_it_is_opened(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path, kind in ((pipe, "a pipe"), (tmp_path, "a folder"), ("/dev/zero", "a device")):
        with pytest.raises(ValueError, match=f"expected a regular file, got {kind}"):
            read_bytes(path, 1000)


def test_a_file_too_large_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "large"
    with open(path, "wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(ValueError, match=r"large: expected at most 1 MB, got 1,048,576 MB"):
        read_bytes(path, 1 << 20)


@pytest.mark.skipif(not os.path.exists("/proc/kmsg"), reason="needs a system that makes files up")
def test_a_file_without_a_size_is_read_no_further_than_it_may_be(tmp_path):
    with pytest.raises(ValueError, match=r"expected at most .* got more"):
        read_bytes("/proc/self/maps", 100)


@pytest.mark.parametrize("name", ["a\0b", "n" * 300, "a\x1b[31m\n"])
def test_an_impossible_name_costs_one_line(name):
    with pytest.raises((ValueError, FileNotFoundError)) as caught:
        regular_file(name, 1000)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "text, message",
    [
        ("[]", "expected a JSON object, got []"),
        ("1", "expected a JSON object, got 1"),
        ("null", "expected a JSON object, got None"),
        ("", "not valid JSON: "),
        ("{", "not valid JSON: "),
        ('{"a": NaN}', "not valid JSON: expected finite numbers, got NaN"),
        ('{"a": [1.0, -Infinity]}', "expected finite numbers, got -Infinity"),
        ('{"a": [1.0, 1e999]}', "a[1]: expected a finite number, got inf"),
        (
            '{"a": {"b": %s}}' % ("9" * 400),
            "a.b: expected a number of at most 64 bits, got an integer of some 400",
        ),
        ('{"a": %s}' % ("9" * 5000), "an integer of thousands of digits"),
        ('{"a": "\\ud800"}', "a: expected text, got half of a character in '\\ud800'"),
        ('{"\\udc00": 1}', "expected texts as keys"),
        ('{"a": 1, "a": 2}', "the key 'a' stands there twice"),
        ('{"a": ' + 40 * "[" + 40 * "]" + "}", "expected at most 32 levels of nesting"),
        ("[" * 100_000, "nested too deeply"),
        ('{"a":' * 100_000, "nested too deeply"),
    ],
)
def test_json_that_is_no_plain_object_is_refused_in_one_line(text, message):
    with pytest.raises(ValueError) as caught:
        parse_json(text, "a.json")
    assert str(caught.value).startswith("a.json: ")
    assert message in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "text, message",
    [
        ("a = " + "[" * 100_000, "nested too deeply"),
        ("a = " + "[" * 40 + "]" * 40, "expected at most 32 levels of nesting"),
        ("[" + "a." * 100_000 + "a]", "a key of more than 32 parts"),
        ("a." * 100_000 + "a = 1", "a key of more than 32 parts"),
        ("a = " + "9" * 400, "a: expected a number of at most 64 bits, got an integer of some 400 digits"),
        ("a = " + "9" * 5000, "an integer of thousands of digits"),
        ('a = "\\ud800"', "not valid TOML"),
        ("a", "not valid TOML"),
        ("a = 1\na = 2", "not valid TOML"),
    ],
)
def test_toml_of_any_depth_is_refused_in_one_line(tmp_path, text, message):
    path = tmp_path / "a.toml"
    path.write_text(text)
    began = time.perf_counter()
    with pytest.raises(ValueError, match=r"a\.toml: ") as caught:
        read_toml(path)
    assert time.perf_counter() - began < 5.0
    assert message in str(caught.value)
    assert str(caught.value).isprintable()


def test_a_new_file_gets_what_the_umask_says_and_an_old_one_keeps_its_mode(tmp_path):
    script = (
        "import os, sys; os.umask(0o027); from flapgym.core.atomic import write_atomically as w; "
        "w(sys.argv[1], b'new')"
    )
    for name, before, after in (("new", None, 0o640), ("old", 0o600, 0o600), ("shared", 0o664, 0o664)):
        path = tmp_path / name
        if before is not None:
            path.write_text("old")
            path.chmod(before)
        subprocess.run([sys.executable, "-c", script, str(path)], check=True)
        assert stat.S_IMODE(path.stat().st_mode) == after
        assert path.read_text() == "new"


def test_a_link_is_followed_and_stays(tmp_path):
    (tmp_path / "there").mkdir()
    for name in ("old", "new"):
        (tmp_path / name).symlink_to(tmp_path / "there" / name)
    (tmp_path / "there" / "old").write_text("before")
    for name in ("old", "new"):
        write_atomically(tmp_path / name, b"after")
        assert (tmp_path / name).is_symlink()
        assert (tmp_path / "there" / name).read_text() == "after"
    assert sorted(os.listdir(tmp_path / "there")) == ["new", "old"]


def test_what_is_no_regular_file_is_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    (tmp_path / "link").symlink_to(pipe)
    (tmp_path / "folder").mkdir()
    for name, kind in (("pipe", "a pipe"), ("link", "a pipe"), ("folder", "a folder")):
        with pytest.raises(
            FileExistsError, match=f"{name}: expected a regular file or none there, got {kind}"
        ):
            write_atomically(tmp_path / name, b"content")
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert sorted(os.listdir(tmp_path)) == ["folder", "link", "pipe"]
    with pytest.raises(FileExistsError, match="got a device"):
        check_target("/dev/null")


@pytest.mark.parametrize("failing", [0, 1, 2])
def test_files_written_together_all_stay_as_they_were_if_one_fails(tmp_path, monkeypatch, failing):
    (tmp_path / "a").write_text("old a")
    (tmp_path / "c").write_text("old c")
    replace, calls = os.replace, []

    def fail(source, target):
        calls.append(target)
        if len(calls) == failing + 1:
            raise OSError("disk full")
        replace(source, target)

    monkeypatch.setattr("flapgym.core.atomic.os.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_together({tmp_path / name: b"new" for name in "abc"})
    assert sorted(os.listdir(tmp_path)) == ["a", "c"]
    assert ((tmp_path / "a").read_text(), (tmp_path / "c").read_text()) == ("old a", "old c")


def test_nothing_is_written_where_one_of_several_cannot_be(tmp_path):
    (tmp_path / "b").mkdir()
    with pytest.raises(FileExistsError):
        write_together({tmp_path / "a": b"new", tmp_path / "b": b"new"})
    assert os.listdir(tmp_path) == ["b"]


def test_a_name_as_long_as_it_may_be_is_written(tmp_path):
    path = tmp_path / ("n" * 255)
    write_atomically(path, b"content")
    assert path.read_bytes() == b"content"


def test_what_a_killed_run_left_is_removed_by_the_next_and_a_running_one_keeps_its_own(tmp_path):
    script = (
        "import os, sys, time, flapgym.core.atomic as a\n"
        "def sleep(*_):\n    print('there', flush=True)\n    time.sleep(60)\n"
        "a.os.replace = sleep\n"
        "a.write_atomically(sys.argv[1], b'half')\n"
    )
    writers = [
        subprocess.Popen([sys.executable, "-c", script, str(tmp_path / "a")], stdout=subprocess.PIPE)
        for _ in range(2)
    ]
    try:
        for writer in writers:
            assert writer.stdout.readline() == b"there\n"
        assert len(os.listdir(tmp_path)) == 2
        writers[0].send_signal(signal.SIGKILL)
        writers[0].wait()
        write_atomically(tmp_path / "b", b"whole")
        assert len(os.listdir(tmp_path)) == 2  # b, and what the running one holds
    finally:
        for writer in writers:
            writer.kill()
            writer.wait()
            writer.stdout.close()
    write_atomically(tmp_path / "b", b"whole")
    assert os.listdir(tmp_path) == ["b"]


def test_what_is_written_is_what_is_read(tmp_path):
    value = {"a": [1.0, 2, "ü", None, True, {"b": []}]}
    write_atomically(tmp_path / "a.json", json.dumps(value).encode())
    assert parse_json(read_text(tmp_path / "a.json", 1000), "a.json") == value


def _write_often(folder, sign):
    for _ in range(50):
        write_atomically(folder / "single", 1000 * sign)
        write_together({folder / "a": 100 * sign, folder / "b": 100 * sign})


def test_processes_that_write_the_same_files_at_once_leave_one_s_and_nothing_else(tmp_path):
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=_write_often, args=(tmp_path, sign)) for sign in (b"x", b"y", b"z")]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert [writer.exitcode for writer in writers] == [0, 0, 0]
    assert sorted(os.listdir(tmp_path)) == ["a", "b", "single"]
    assert (tmp_path / "single").read_bytes() in (1000 * b"x", 1000 * b"y", 1000 * b"z")


def test_a_picture_is_written_like_data(tmp_path, monkeypatch):
    figure = pytest.importorskip("matplotlib.figure").Figure()
    pipe = tmp_path / "pipe.png"
    os.mkfifo(pipe)
    with pytest.raises(FileExistsError, match="got a pipe"):
        write_picture(pipe, figure)
    write_picture(tmp_path / "whole.png", figure)
    before = (tmp_path / "whole.png").read_bytes()
    assert before.startswith(b"\x89PNG")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("flapgym.core.atomic.os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_picture(tmp_path / "whole.png", figure)
    assert (tmp_path / "whole.png").read_bytes() == before
    assert sorted(os.listdir(tmp_path)) == ["pipe.png", "whole.png"]


def test_no_program_writes_files_past_the_one_writer():
    folders = (ROOT / name for name in ("flapgym", "baselines", "benchmarks", "train"))
    sources = (path for folder in folders for path in folder.rglob("*.py"))
    past = {
        path
        for path in sources
        if re.search(r"savefig\((?!content)|\.write_(text|bytes)\(", path.read_text())
    }
    # The fuzzer and the page of errors spoil files of their own.
    assert {path.relative_to(ROOT).parts[1] for path in past} <= {"fuzz", "errors"}


def test_a_size_limit_is_told_in_a_unit_that_leaves_digits(tmp_path):
    (tmp_path / "large.toml").write_bytes(b"#" * 2 * LARGEST_SETTINGS)
    with pytest.raises(ValueError, match="expected at most 256 kB, got 512 kB"):
        regular_file(tmp_path / "large.toml", LARGEST_SETTINGS)
