# SPDX-License-Identifier: Apache-2.0
"""Files that are there as a whole or not at all: written beside, then renamed."""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file or raise an `OSError` with its name, which leaves an older one.

    A link is replaced, not followed; a pipe and a device, such as /dev/stdout, are written to.
    """
    data = content.encode() if isinstance(content, str) else content
    if _is_stream(path):
        path.write_bytes(data)
        return
    with _draft(path) as draft, draft.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _is_stream(path: Path) -> bool:
    """True for a pipe or a device, by a link only below /dev."""
    if path.is_symlink() and not path.absolute().is_relative_to("/dev"):
        return False
    return path.exists() and not path.is_file() and not path.is_dir()


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """The draft of a folder, which gets its name at the end; after an error there is none."""
    with _draft(path) as draft:
        draft.mkdir(parents=True)
        yield draft


@contextmanager
def _draft(path: Path) -> Iterator[Path]:
    """A new name beside the path, to be written; renamed at the end, deleted after an error."""
    draft = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        yield draft
        draft.rename(path)
    except BaseException as error:
        with suppress(OSError):  # there may be none
            if draft.is_dir():
                shutil.rmtree(draft)
            else:
                draft.unlink()
        if isinstance(error, OSError) and str(error.filename or draft).startswith(str(draft)):
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise
