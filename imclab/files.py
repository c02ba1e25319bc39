"""Files are written whole or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from imclab.errors import Fault, InputError, OutputError


def check_output(path: str | Path) -> Path:
    """Return ``path`` when a file can be written there; tell so before long work, not after it.

    Raises
    ------
    OutputError
        When the folder does not exist or may not be written to, or ``path`` is a folder.
    """
    path = Path(path)
    if path.is_dir():
        reason = "it is a folder"
    elif not path.parent.is_dir():
        reason = f"{path.parent} is no folder"
    elif not os.access(path.parent, os.W_OK):
        reason = f"{path.parent} may not be written to"
    else:
        return path
    raise OutputError(f"{path}: cannot be written ({reason}). Name a file in a folder that exists.")


def check_folder(path: str | Path) -> Path:
    """Return ``path`` when a folder is there or can be made there; tell so before long work.

    Raises
    ------
    OutputError
        When the path, or what it lies in, is a file or may not be written to.
    """
    path = Path(path)
    nearest = next(place for place in (path, *path.absolute().parents) if place.exists())
    if nearest.is_dir() and os.access(nearest, os.W_OK):
        return path
    reason = f"{nearest} {'may not be written to' if nearest.is_dir() else 'is a file'}"
    raise OutputError(f"{path}: no folder can be made there ({reason}). Name a folder in one that exists.")


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """Give a temporary name beside ``path``; rename it to ``path`` only when the block succeeds.

    Raises
    ------
    OutputError
        When the folder does not exist or may not be written to.
    """
    path = check_output(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.part")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def folder_written_whole(path: str | Path) -> Iterator[Path]:
    """Give an empty temporary folder beside ``path``; rename it to ``path`` when the block succeeds.

    Raises
    ------
    InputError
        When ``path`` is a file or a folder that holds something already.
    OutputError
        When it cannot be made.
    """
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise InputError(str(folder), [Fault("output", "a file", "a folder")])
    if folder.is_dir() and any(folder.iterdir()):
        wanted = "a folder that is empty or does not exist"
        raise InputError(str(folder), [Fault("output", "a folder with files in it", wanted)])
    check_folder(folder)
    temporary = folder.with_name(f".{folder.name}.{os.getpid()}.{secrets.token_hex(4)}.part")
    try:
        temporary.mkdir(parents=True)
        yield temporary
        if folder.is_dir():
            folder.rmdir()
        temporary.replace(folder)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror or error})") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
