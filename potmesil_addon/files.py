"""Whole files or none: results are written beside their place, flushed to disk and renamed into it."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import platform
import re
import secrets
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from .cut import is_cut
from .errors import OutputError

_STALE_AFTER: Final = 24 * 3600.0
"""Age in seconds from which a left-over part of a killed process is taken for abandoned."""

_SWEEP_EVERY: Final = 3600.0
"""Seconds after which a process looks again for abandoned parts in a folder; shares list slowly."""

_PATIENCE: Final = 2.0
"""Seconds for which a rename is tried again where another program has one of the files open."""

_NAP: Final = 0.05
"""Seconds between these tries."""

_TRIES: Final = 8
"""Names tried for a part; containers can have their host's name and all the same process id."""

_NAME_BYTES: Final = 255
"""Longest name of a file where the system does not tell."""

_PATH_BYTES: Final = 259 if sys.platform == "win32" else 1023
"""Longest path that programs on Windows, elsewhere Blender, take; Blender cuts longer ones."""

_PART: Final = re.compile(r"\..*\.[A-Za-z0-9_-]+\.\d+(?:-[0-9a-f]+)?\.part", re.DOTALL)
"""Names of parts, without the suffix: a dot, the stem, the host, the process, ``.part``."""

_UNSUPPORTED: Final = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)
"""What file systems say that cannot flush a file or a folder."""

_HELD: Final = (errno.EACCES, errno.EPERM, errno.EBUSY, errno.ETXTBSY)
"""What Windows and its shares say of a rename while another program has one of the files open."""

_ELSEWHERE: Final = "choose another folder"
_NO_SHARE: Final = "check the connection to the network folder"

_ADVICE: Final[dict[int, str]] = {
    errno.ENOSPC: f"free space on the disk or {_ELSEWHERE}",
    errno.EDQUOT: f"free space of yours on the disk or {_ELSEWHERE}",
    errno.EFBIG: f"the disk or a limit of the system takes no file of this size, {_ELSEWHERE}",
    errno.EROFS: f"the disk can only be read, {_ELSEWHERE}",
    errno.EACCES: f"get the right to write there or {_ELSEWHERE}",
    errno.EPERM: f"get the right to write there or {_ELSEWHERE}",
    errno.EBUSY: "close the file where it is open",
    errno.ETXTBSY: "close the file where it is open",
    errno.ENOENT: "the folder was removed meanwhile, make it and the file again",
    errno.EIO: "check the disk, and the connection to it",
    errno.ESTALE: _NO_SHARE,
    errno.ENOTCONN: _NO_SHARE,
    errno.ETIMEDOUT: _NO_SHARE,
    errno.EHOSTDOWN: _NO_SHARE,
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.EILSEQ: "the disk does not take this name, choose another one",
    errno.EINVAL: "the disk may not take this name, choose another one",
    errno.EISDIR: "a folder has this name, choose another one",
    errno.ENOTDIR: "a file has the name of the folder, choose another one",
    errno.EEXIST: "a file has the name of the folder, choose another one",
}
"""What to do, by what the system says."""

_PROBE: Final = 1 << 16
"""Bytes by which a file is made longer to see why it could not be written."""

_LONGEST_SUFFIX: Final = 16
"""What is longer, in characters, is not the kind of a file but the end of its name."""

_WORKING: Final = "potmesil_work_"
"""Begin of a working folder's name, before its process' number."""

_swept: dict[str, float] = {}
"""When this process looked for abandoned parts, by folder and suffix."""


class _RefusedError(RuntimeError):
    """Says what is wrong and what to do, in words of our own."""


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary path that becomes `path` only if the block ends without an error.

    Whoever reads `path` meanwhile, and whenever the process is killed, sees the old file whole or the
    new one. Several processes on several machines may write the same file: the last one wins.

    Parameters
    ----------
    path : Path
        Where the file will be. Its folder is made if it is missing. Of a link, what it points to is written.

    Yields
    ------
    Path
        A path in the same folder, ``.STEM.HOST.PID.part.SUFFIX``, of an empty file that the block writes.

    Raises
    ------
    OutputError
        If the folder or the file cannot be written. An older file at `path` is then as it was.
    """
    part = None
    try:
        _refuse_others(path)
        place = Path(os.path.realpath(path)) if path.is_symlink() else path
        place.parent.mkdir(parents=True, exist_ok=True)
        part = _reserve(place)
        _remove_stale_parts(part)
        yield part
        _flush(part)
        refuse_cut(part)
        _put_in_place(part, place)
        # Another process may have this name from here on.
        part = None
        _flush_folder(place.parent)
    except (OSError, RuntimeError) as error:
        raise OutputError(f"Cannot write '{path}': {_reason(error, part)}.") from error
    finally:
        if part is not None:
            with contextlib.suppress(OSError):
                part.unlink()


@contextlib.contextmanager
def utf8_path(path: Path) -> Iterator[str]:
    """Give a path of a file in UTF-8; Linux lets names be any bytes, and OpenEXR takes none but these.

    Parameters
    ----------
    path : Path
        A file that exists.

    Yields
    ------
    str
        The path, or another one under which the file can be opened.

    Raises
    ------
    OSError
        If the path is not in UTF-8 and the file cannot be opened.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        number = os.open(path, os.O_RDONLY)
        try:
            yield f"/dev/fd/{number}"
        finally:
            os.close(number)
    else:
        yield str(path)


def refuse_cut(part: Path) -> None:
    """Raise an error for an image that lacks its end; Blender's writers and OpenEXR do not always say so.

    Parameters
    ----------
    part : Path
        What `whole_file` gave. It looks itself in the end; only who reads the image before needs to ask.

    Raises
    ------
    OSError, RuntimeError
        Of which `whole_file` makes a sentence.
    """
    if is_cut(part):
        _grow(part)
        raise _RefusedError(f"it was cut short; {_ADVICE[errno.ENOSPC]}")


def _refuse_others(path: Path) -> None:
    """Raise an error where something is that a file must not replace: a folder, a device, a pipe."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(mode):
        raise _RefusedError("it is a device or a pipe and no file; choose another name")


def _reserve(path: Path) -> Path:
    """Make the empty file that will be written, under a name that no other process has."""
    tag = str(os.getpid())
    for tries_left in reversed(range(_TRIES)):
        part = path.with_name(_part_name(path, _host(), tag, _longest_name(path.parent)))
        try:
            os.close(os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        except FileExistsError:
            if not tries_left:
                raise
            tag = f"{os.getpid()}-{secrets.token_hex(4)}"
        else:
            break
    return part


def _host() -> str:
    """Return this machine's name as a part of a file's name."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", platform.node())[:64] or "host"


def _longest_name(folder: Path) -> int:
    """Return how many bytes the name of a file may have in a folder."""
    longest = _NAME_BYTES
    if sys.platform != "win32":
        with contextlib.suppress(OSError, ValueError):
            told = os.pathconf(folder, "PC_NAME_MAX")
            longest = told if 0 < told < longest else longest
    left = _PATH_BYTES - len(os.fsencode(folder.absolute())) - 1
    return min(longest, left) if left > 0 else longest


def _part_name(path: Path, host: str, tag: str, longest: int) -> str:
    """Return the name of a file's part; a stem that is too long or not UTF-8 is cut and gets a checksum.

    What writes images takes no other names than UTF-8.
    """
    suffix = path.suffix if len(path.suffix) <= _LONGEST_SUFFIX else ""
    end = f".{host}.{tag}.part{suffix}"
    room = longest - len(f".{end}".encode(errors="surrogateescape"))
    stem = path.name.removesuffix(suffix).encode(errors="surrogateescape")
    kept = path.name.removesuffix(suffix).encode(errors="ignore")
    if len(stem) > room or kept != stem:
        checksum = hashlib.sha256(stem).hexdigest()[:8]
        kept = kept[: max(room - 1 - len(checksum), 0)] + f"~{checksum}".encode()
    return f".{kept.decode(errors='ignore')}{end}"


def _remove_stale_parts(own: Path) -> None:
    """Remove what killed processes left in a part's folder a day or more ago."""
    now = time.monotonic()
    key = f"{own.parent.absolute()}{os.sep}{own.suffix}"
    if now - _swept.get(key, -_SWEEP_EVERY) < _SWEEP_EVERY:
        return
    _swept[key] = now
    with contextlib.suppress(OSError):
        # The clock that dates files on a share may be another one than this machine's.
        today = own.stat().st_mtime
        with os.scandir(own.parent) as entries:
            names = [entry.name for entry in entries if entry.name.startswith(".")]
        for name in names:
            old = own.with_name(name)
            if old.suffix == own.suffix and _PART.fullmatch(name.removesuffix(own.suffix)):
                with contextlib.suppress(OSError):
                    if today - old.lstat().st_mtime > _STALE_AFTER:
                        old.unlink()


@contextlib.contextmanager
def working_folder() -> Iterator[Path]:
    """Give a folder for what nobody keeps, and remove those that killed processes left a day or more ago.

    Yields
    ------
    Path
        A new folder among the system's temporary ones, which goes with the block.
    """
    for old in Path(tempfile.gettempdir()).glob(f"{_WORKING}*_*"):
        with contextlib.suppress(OSError, ValueError):
            # On a shared disk it may be another machine's.
            asleep = time.time() - old.stat().st_mtime > _STALE_AFTER
            if asleep and not _is_running(int(old.name.removeprefix(_WORKING).partition("_")[0])):
                shutil.rmtree(old, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=f"{_WORKING}{os.getpid()}_") as folder:
        yield Path(folder)


def _is_running(process: int) -> bool:
    """Return whether there is a process of a number here; False where that is not known."""
    if os.name == "nt":
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _flush(part: Path) -> None:
    """Have a written file on the disk; what went wrong in the background is said here."""
    if not part.stat().st_size:
        # OpenEXR does not say what becomes of its last bytes, which can be all.
        _grow(part)
        raise _RefusedError("nothing was written; check the disk")
    with part.open("rb+") as stream:
        _sync(stream.fileno())


def _sync(number: int) -> None:
    """Have what was written to an open file or folder on the disk, where the file system can."""
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            raise


def _grow(part: Path) -> None:
    """Raise OSError if a file that could not be written cannot be made longer either."""
    with part.open("ab") as stream:
        stream.write(bytes(_PROBE))
        stream.flush()
        _sync(stream.fileno())


def _put_in_place(part: Path, path: Path) -> None:
    """Rename a file over another one, and wait a little for who has that one open."""
    until = time.monotonic() + _PATIENCE
    while True:
        try:
            part.replace(path)
        except OSError as error:
            if error.errno not in _HELD or not part.exists():
                raise
            if time.monotonic() > until:
                raise _RefusedError(
                    f"{_said(error)}; close the file where it is open or get the right to replace it"
                ) from error
            time.sleep(_NAP)
        else:
            return


def _flush_folder(folder: Path) -> None:
    """Have a rename on the disk, where the system flushes folders."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    try:
        number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:  # who may write into a folder need not have the right to list it
        return
    try:
        _sync(number)
    finally:
        os.close(number)


def _said(error: OSError) -> str:
    return error.strerror or type(error).__name__


def _reason(error: OSError | RuntimeError, part: Path | None) -> str:
    """Return what the system says, and what to do."""
    if isinstance(error, OSError):
        advice = _ADVICE.get(error.errno or 0, "check the folder and the disk")
        return f"{_said(error)}; {advice}"
    if isinstance(error, _RefusedError):
        return str(error)
    # OpenEXR and Blender say what the system said amid words of their own, or that there was an error.
    text = " ".join(str(error).split()).removesuffix(".")
    if part is not None:
        text = text.replace(str(part), "")
    for code, advice in _ADVICE.items():
        if os.strerror(code) in text:
            return f"{os.strerror(code)}; {advice}"
    if part is not None:
        try:
            _grow(part)
        except OSError as found:
            return _reason(found, None)
    return f"{text}; check the folder, the disk and the output settings"
