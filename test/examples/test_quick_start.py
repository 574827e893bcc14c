# SPDX-License-Identifier: Apache-2.0
"""The notebook of the quick start runs from a kernel of its own, and is kept without outputs."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.long
def test_the_notebook_runs(tmp_path, monkeypatch):
    """The pendulum follows a swing of 2 rad to 1 % of it, and the last cell draws it."""
    import nbformat
    from nbclient import NotebookClient

    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    notebook = nbformat.read(ROOT / "examples" / "quick_start.ipynb", as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs or cell.execution_count for cell in code)
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    printed = "".join(output.get("text", "") for cell in code for output in cell.outputs)
    assert float(re.search(r"RMSE ([\d.]+) rad", printed)[1]) < 0.02
    assert any("image/png" in output.get("data", {}) for output in code[-1].outputs)
