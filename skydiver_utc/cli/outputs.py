# SPDX-License-Identifier: Apache-2.0
"""Files and folders that a command writes; checked before any work is done."""

from pathlib import Path
from typing import TYPE_CHECKING

from skydiver_utc.cli.errors import CommandError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from skydiver_utc.parameters import Parameters

FORMS = ("png", "svg", "pdf")  # of figures, see `skydiver_utc.analysis.style.picture`


def prepare_folder(folder: Path | None) -> None:
    """Make the folder, if one is given."""
    if folder is None:
        return
    if folder.exists() and not folder.is_dir():
        raise CommandError(f"--out {folder} is a file: give a folder")
    folder.mkdir(parents=True, exist_ok=True)


def check_figure_path(path: Path | None) -> None:
    """Refuse a figure that could not be written."""
    if path is None:
        return
    if _form_of(path) not in FORMS:
        raise CommandError(f"--figure {path} is none of {', '.join(FORMS)}: let its name end in one of them")
    if not path.parent.is_dir():
        raise CommandError(
            f"there is no folder {path.parent} for the figure {path.name}: make it, or choose another"
        )


def save_figure(path: Path, figure: "Figure") -> None:
    """Write a figure in the form that the ending of the name tells."""
    from skydiver_utc.analysis.style import picture
    from skydiver_utc.parameters.files import write_file

    write_file(path, picture(figure, _form_of(path)))


def _form_of(path: Path) -> str:
    return path.suffix.lower().removeprefix(".")


def name_of(out: Path | None, default: str, force: bool) -> str:
    """The name of what will be written into a YAML file; refuses a path that cannot be written."""
    if out is None:
        return default
    if out.suffix != ".yaml" or not out.parent.is_dir():
        raise CommandError(f"{out} must end in .yaml and lie in a folder that exists: choose another")
    if out.exists() and not force:
        raise CommandError(f"{out} exists: choose another file, or add --force to overwrite it")
    return out.stem


def write(parameters: "Parameters", out: Path | None) -> None:
    """Write settings into a YAML file, or on the screen."""
    from skydiver_utc.parameters.files import write_file
    from skydiver_utc.parameters.yaml_io import write_yaml

    content = write_yaml(parameters.as_dict())
    if out is None:
        print(content, end="")
    else:
        write_file(out, content)
