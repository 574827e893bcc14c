"""Folders that a verb writes several files into."""

from pathlib import Path

from skydiver_utc.verbs.errors import VerbError


def prepared_folder(folder: Path) -> Path:
    """Make the folder before any work is done, so that nothing is computed that could not be written."""
    if folder.exists() and not folder.is_dir():
        raise VerbError(f"--out {folder} is a file: give a folder")
    folder.mkdir(parents=True, exist_ok=True)
    return folder
