"""The notebook runs from end to end, as Jupyter would run it, and does what it says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest

from tests.support import ROOT


@pytest.mark.slow
def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mpl.use("agg")
    (tmp_path / "robots").symlink_to(ROOT / "robots")
    monkeypatch.chdir(tmp_path)
    cells = json.loads((ROOT / "docs" / "notebook.ipynb").read_text(encoding="utf-8"))["cells"]
    sources = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert len([line for source in sources for line in source.splitlines() if line]) == 15
    names: dict[str, Any] = {}
    for source in sources:
        exec(compile(source, "notebook.ipynb", "exec"), names)
    assert names["sent"].faults == ()
    table = pd.read_csv(tmp_path / "outputs" / "notebook" / "motion.csv")
    assert len(table) == 1001
    speeds = table.filter(like="_velocity").to_numpy()
    np.testing.assert_allclose(speeds[[0, -1]], 0.0, atol=1e-9)  # rests at both ends
    axes = mpl.pyplot.gca()
    assert [line.get_label() for line in axes.get_lines()] == ["lsv: solved", "global: solved"]
    mpl.pyplot.close("all")
