# SPDX-License-Identifier: Apache-2.0
"""Files that are there as a whole or not at all: written beside, then renamed."""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def write_file(path: Path, content: str | bytes) -> None:
    """Write a file; a failure, an `OSError` with this name, leaves an older one. A link is replaced, not followed."""
    with _draft(path) as draft, draft.open("xb") as file:
        file.write(content.encode() if isinstance(content, str) else content)
        file.flush()
        os.fsync(file.fileno())


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
        if draft.is_dir():
            shutil.rmtree(draft, ignore_errors=True)
        else:
            draft.unlink(missing_ok=True)
        if isinstance(error, OSError) and str(error.filename or draft).startswith(str(draft)):
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise
