"""What the documents print, as read from them, and the results of a reproduction's runs."""

from __future__ import annotations

import re
from pathlib import Path

from pipeline.config import documents
from pipeline.reproduce.results import Results

WORDS = {"b": "better", "m": "misprint", "d": "differs", "t": "timing"}
# Every result that the documents print, in their order, as read from them, and the verdict on it: b better,
# m misprint, d differs, t a computing time, else reproduced. A number that the text repeats from a table stands once.
PRINTED = {
    ("pmke", "Table 3"): "0.615 d | 0.615 d | 0.307 d",
    ("pmke", "Section 3.1"): "0.468 | 0",
    ("pmke", "Table 5"): """
        5.98e-3 m | 8.81e-3 m | +47.4 d | 5.97e-3 m | -0.13 d | 0.915 t |
        4.08e-3 b | 5.37e-3   | +31.7 d | 3.87e-3   | -5.03 d | 0.934 t |
        7.57e-3 b | 2.17e-2 d | +187 d  | 6.09e-3   | -19.5 d | 0.961 t |
        3.97e-2   | 5.17e-2   | +30.1 d | 3.03e-2   | -23.6   | 0.914 t""",
    ("pmke", "Section 3.2"): "187.36 d | 0.0011 t | 0.0010 t | 0.0021 t",
    ("pmke", "Figure 4"): "0.063 | 0.017 d | 0.197 d | 0.203 d | around three times | more than 10 times",
    ("pmke", "Figure 5"): "0.196 m | 0.095 d | 0.529 | 0.613 d",
    ("pmke", "Figure 6"): "6.5 | 0.250 d | 0.186 | 0.261 d | 0.023",
    ("pmke", "Figure 7"): "0.780 d | 0.512",
    ("pmke", "Figure 8"): "0.0556 d | 6.33 d | 0.0998 | 5.71 | always lower d",
    ("global", "Figure 1"): "-4.0733 d | -0.2030 d",
    ("global", "Section 3.2"): "0.4678 | 0.0000 m | 0.0983 | 0.1526 d",
    ("global", "Table 4"): """
        3 d | 0.0532 d | 0.0528 | 8.5e-3 d | 0.0567 d | 0.0563 d | 2.2e-2 d | 0.0673 d | 0.0671 | 3.8e-3 d""",
    ("global", "Table 5"): """
        0.0528 | 0.1827 d | 290 t | 0.0528 | 0.1820 | 218 t |
        0.0795 d | 0.0912 b | 276 t | 0.0808 d | 0.0916 b | 160 t""",
    ("global", "Table 6"): "0.0554 | 1.898 d | 282 t",
    ("global", "Figure 4"): "4.042 | 3.053 | 1.553 d | 0.7068 d",
    ("global", "Figure 6"): "0.29 d | 0.38",
    ("global", "Figure 10"): "0.42 | around 1 % d | around 1 %",
    ("global", "Figure 12"): "4.144 | 5.814 | one order of magnitude higher | only one",
    ("pontryagin", "Figure 3"): "0.0026",
    ("pontryagin", "Figure 4"): "larger than in the previous case",
    ("pontryagin", "Figure 5"): "one order bigger than before | joint variables do not exceed their limits",
    ("pontryagin", "Figure 6"): "0.06",
    ("pontryagin", "Figure 7"): "decreases of one order of magnitude",
}
FIGURES = {"pmke": range(2, 13), "global": range(1, 15), "pontryagin": range(3, 8)}
TABLES = {"pmke": range(2, 6), "global": range(1, 7), "pontryagin": range(0)}


def expected() -> list[tuple[str, str, str, str]]:
    """(document, place, printed, verdict) of every number."""
    rows = []
    for (document, place), cells in PRINTED.items():
        for cell in re.split(r"\s*\|\s*", cells.strip()):
            found = re.fullmatch(r"(.*?)(?: ([bmdt]))?", cell)
            assert found is not None
            rows.append((document, place, found[1], WORDS.get(found[2], "reproduced")))
    return rows


def asked() -> list[documents.Document]:
    return [documents.read(name) for name in documents.DOCUMENTS]


def runs_in(folder: Path) -> dict[str, Results]:
    return {file.parent.name: Results(file.parent) for file in (folder / "runs").glob("*/run.json")}
