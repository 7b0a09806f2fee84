"""Write files whole or not at all: readers see the old one or the new one, never half of one."""

from __future__ import annotations

import contextlib
import io
import os
import stat
import sys
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

if sys.platform != "win32":
    import fcntl

PREFIX, SUFFIX = ".flapgym-", ".tmp"
"""Of temporary files: their names do not depend on the target's, which may be as long as a name can be."""


def write_atomically(path: str | os.PathLike[str], content: bytes) -> None:
    """Replace `path` by `content`; an interrupt leaves what was there before.

    Links are followed, the mode of a file that was there is kept, a new one gets what the umask says.

    Raises
    ------
    OSError
        If nothing can be written there, or there is something that is no regular file.
    """
    write_together({path: content})


def write_together(contents: Mapping[str | os.PathLike[str], bytes]) -> None:
    """Replace several files; if one cannot be written, all stay as they were. Otherwise as `write_atomically`."""
    targets = [check_target(path) for path in contents]
    for folder in {target.parent for target in targets}:
        _remove_leftovers(folder)
    with contextlib.ExitStack() as stack:
        written = [
            _written(stack, target, content)
            for target, content in zip(targets, contents.values(), strict=True)
        ]
        # One rename is whole or not at all by itself; of several, those done are undone.
        kept = [_backup(stack, target) for target in targets] if len(targets) > 1 else []
        try:
            for temporary, target in zip(written, targets, strict=True):
                os.replace(temporary, target)
        except BaseException:
            for temporary, old, target in zip(written, kept, targets, strict=False):
                if temporary.exists():  # an interrupt may come at any moment: what is gone was renamed
                    continue
                if old is None:
                    target.unlink()
                else:
                    os.replace(old, target)
            raise


def write_picture(path: str | os.PathLike[str], figure: Any, dpi: float = 110) -> None:
    """Write a matplotlib figure as data are written; its format follows the name."""
    content = io.BytesIO()
    figure.savefig(content, format=Path(path).suffix[1:], dpi=dpi)
    write_atomically(path, content.getvalue())


def check_target(path: str | os.PathLike[str]) -> Path:
    """The file that writing to `path` would replace or make, links followed.

    Raises
    ------
    OSError
        If it could not be written; the message names the path and says why.
    """
    target = Path(os.path.realpath(path))
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        mode = None
    except OSError as error:
        raise type(error)(f"{path}: cannot be written ({error.strerror})") from None
    if mode is not None and not stat.S_ISREG(mode):
        raise FileExistsError(f"{path}: expected a regular file or none there, got {kind_of_file(mode)}")
    if not target.parent.is_dir():
        folder = target.parent if os.path.islink(path) else Path(path).parent
        raise FileNotFoundError(f"{path}: no folder {folder}; make it first")
    # Renaming asks for nothing but the folder: a file that its owner protected would be replaced all the same.
    if not os.access(target.parent, os.W_OK | os.X_OK) or (
        mode is not None and not os.access(target, os.W_OK)
    ):
        raise PermissionError(f"{path}: cannot be written (no permission); name another file")
    return target


def kind_of_file(mode: int) -> str:
    """In words, what a mode of `os.stat` is of."""
    kinds = {
        stat.S_IFREG: "a regular file",
        stat.S_IFDIR: "a folder",
        stat.S_IFIFO: "a pipe",
        stat.S_IFSOCK: "a socket",
    }
    return kinds.get(stat.S_IFMT(mode), "a device")


def _written(stack: contextlib.ExitStack, target: Path, content: bytes) -> Path:
    """A temporary file beside the target with its content, locked and removed by the stack."""
    temporary = target.parent / f"{PREFIX}{uuid.uuid4().hex}{SUFFIX}"
    # The kernel takes the umask off, which no other way asks for without changing it.
    handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    file = stack.enter_context(os.fdopen(handle, "wb"))
    stack.callback(temporary.unlink, missing_ok=True)
    # Who cleans up removes only what nobody holds; what was removed before it was held is made once more.
    _lock(file)
    if os.fstat(file.fileno()).st_nlink == 0:
        return _written(stack, target, content)
    with contextlib.suppress(FileNotFoundError):
        old = target.stat()
        os.chmod(temporary, stat.S_IMODE(old.st_mode))
        if hasattr(os, "chown") and (old.st_uid, old.st_gid) != (os.geteuid(), os.getegid()):
            with contextlib.suppress(PermissionError):  # only root gives files away
                os.chown(temporary, old.st_uid, old.st_gid)
    file.write(content)
    file.flush()
    os.fsync(file.fileno())
    if sys.platform == "win32":  # no lock to keep, and no open file can be renamed
        file.close()
    return temporary


def _backup(stack: contextlib.ExitStack, target: Path) -> Path | None:
    """What is there now under a second name, or None if nothing is."""
    try:
        file = stack.enter_context(target.open("rb"))
    except FileNotFoundError:
        return None
    # Held before it has the name that who cleans up looks for; others may keep the same.
    _lock(file, shared=True)
    second = target.parent / f"{PREFIX}{uuid.uuid4().hex}{SUFFIX}"
    try:
        os.link(target, second)
    except OSError:  # not every file system has hard links
        return _written(stack, target, file.read())
    stack.callback(second.unlink, missing_ok=True)
    # What replaced the target meanwhile has the second name but is not held.
    with contextlib.suppress(FileNotFoundError):
        if os.path.samestat(os.fstat(file.fileno()), second.stat()):
            return second
    return _backup(stack, target)


def _remove_leftovers(folder: Path) -> None:
    """Remove temporary files whose writers were killed: a lock ends with who holds it."""
    for left in folder.glob(f"{PREFIX}*{SUFFIX}"):
        with contextlib.suppress(OSError), open(left, "rb") as file:
            _lock(file, wait=False)
            left.unlink()


def _lock(file: Any, wait: bool = True, shared: bool = False) -> None:
    """Lock a file until it is closed, beside others or alone; where there are no such locks, no open file is removed.

    Raises
    ------
    OSError
        If another process holds it and `wait` is false.
    """
    if sys.platform == "win32":
        return
    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB))
    except OSError:  # a file system without locks
        if not wait:
            raise
