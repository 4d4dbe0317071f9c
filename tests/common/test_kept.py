"""Kept results come back to the last bit, and nothing else comes back at all."""

from __future__ import annotations

import io
import pickle
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from pipeline.common import kept
from pipeline.methods.global_planner.optimum import Optimum
from pipeline.methods.pareto import Point


def test_results_come_back_to_the_last_bit(rng: np.random.Generator) -> None:
    solves = [{"cost": 0.1 + 0.2, "status": "success", 1: (np.float64(np.pi), None, True)}]
    optimum = Optimum(rng.normal(size=(5, 3)), float("inf"), True, "success", solves=solves)
    back = kept.loads(kept.dumps(optimum))
    assert back.q.tobytes() == optimum.q.tobytes()
    assert (back.cost, back.converged, back.status, back.continuous) == (np.inf, True, "success", True)
    assert back.solves == solves
    assert type(back.solves[0][1][0]) is np.float64
    point = Point("weights", (0.5, 0.5), None, np.nan, q=None)
    assert repr(kept.loads(kept.dumps(point))) == repr(point)


@pytest.mark.parametrize("value", [{1, 2}, object(), np.array([None]), Path("x")])
def test_what_is_no_plain_result_is_refused(value: object) -> None:
    with pytest.raises(TypeError):
        kept.dumps(value)


class Code:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return Path.touch, (Path("ran"),)  # type: ignore[return-value]


@dataclass
class Foreign:
    def __post_init__(self) -> None:
        Path("ran").touch()


def sealed(content: bytes) -> bytes:
    """With the digest that belongs to it: whoever can write a file can write that too."""
    import hashlib

    return content + hashlib.sha256(content).digest()


def archive(document: bytes, **arrays: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez(file, document=np.frombuffer(document, np.uint8), **arrays)
    return sealed(file.getvalue())


FOREIGN = {
    "pickle": sealed(pickle.dumps(Code())),
    "pickled array": archive(b'{"array": 0}', array_0=np.array([Code()], dtype=object)),
    "function": archive(b'{"of": ["pipeline.common.files", "sweep_unfinished"], "has": {"folder": "."}}'),
    "other package": archive(b'{"of": ["subprocess", "Popen"], "has": {"args": ["touch", "ran"]}}'),
    "other dataclass": archive(f'{{"of": ["{__name__}", "Foreign"], "has": {{}}}}'.encode()),
    "no dataclass": archive(b'{"of": ["pipeline.common.errors", "InputError"], "has": {}}'),
    "module not loaded": archive(b'{"of": ["pipeline.nowhere", "X"], "has": {}}'),
    "no table": archive(b'{"of": 3}'),
    "no JSON": archive(b"{"),
    "deep": archive(b"[" * 100_000),
    "empty": b"",
}


@pytest.mark.parametrize("case", FOREIGN)
def test_what_somebody_else_wrote_runs_nothing(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=r"no result|not what was written"):
        kept.loads(FOREIGN[case])
    assert list(tmp_path.iterdir()) == []


def test_a_result_under_the_digest_of_another_is_refused() -> None:
    one, other = (kept.dumps(np.full(4, value)) for value in (1.5, 2.5))
    with pytest.raises(ValueError, match="not what was written"):
        kept.loads(other[:-32] + one[-32:])
