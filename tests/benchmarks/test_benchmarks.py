"""The benchmarks run, once and small: their times are not judged, what they compare is."""

from __future__ import annotations

import re

import casadi as ca
import numpy as np
import pytest

from pipeline.build.problem import prepare
from tests.benchmarks import __main__ as benchmarks
from tests.benchmarks import peer, planner, scaling, updates
from tests.benchmarks.spatial import SpatialArm
from tests.support import FEW_STARTS, composed


def line_of(name: str, out: str) -> list[float]:
    """Our time, the peer's and their ratio."""
    (found,) = re.findall(rf"^{re.escape(name)} +(\S+) +(\S+) +(\S+) ", out, re.M)
    return [float(number) for number in found]


@pytest.mark.slow
def test_small_programs(capsys: pytest.CaptureFixture[str]) -> None:
    benchmarks.predictions(repeats=1)
    benchmarks.fine_solve(repeats=1, steps=50)
    out = capsys.readouterr().out
    for name in ("PMKE prediction (trajectory 3)", "fine solve (51 knots), peer in SX"):
        assert all(number > 0 for number in line_of(name, out))
    assert float(re.findall(r"costs agree to (\S+)", out)[0]) < 1e-4
    assert all(float(gap) < 1e-4 for gap in re.findall(r"motions agree to (\S+) rad", out))


@pytest.mark.slow
def test_updates(capsys: pytest.CaptureFixture[str]) -> None:
    updates.trajectory("traj4", 1, "method.pmke.dt=0.1", "method.pmke.update_interval=1")
    out = capsys.readouterr().out
    assert all(number > 0 for number in line_of("traj4", out))
    assert float(re.findall(r"costs agree to (\S+),", out)[0]) < 1e-5
    assert float(re.findall(r"integrals to (\S+) of", out)[0]) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(("name", "steps"), [("sim1", 12), ("sim5", 24), ("panda_pose", 12), ("floating3r", 12)])
def test_the_planner_beside_its_peer(name: str, steps: int, capsys: pytest.CaptureFixture[str]) -> None:
    """sim1: energy, free; sim5: a cycle with limits; panda_pose: in space; floating3r: momentum."""
    few = (*FEW_STARTS, "method.global.nodes=60", "method.global.optimised=6")
    planner.experiment(name, *few, f"timing.steps={steps}", f"method.global.coarse_steps={steps // 2}", repeats=1)
    out = capsys.readouterr().out
    assert all(number > 0 for number in line_of(name, out))
    costs = {label: float(cost) for label, cost in re.findall(r"^  (ours|peer) +(\S+)", out, re.M)}
    assert costs["ours"] == pytest.approx(costs["peer"], rel=1e-5)
    assert float(re.findall(r"costs within (\S+),", out)[0]) < 1e-9
    assert float(re.findall(r"limits kept to (\S+)", out)[0]) < 1e-6


def test_the_peers_torques_in_space_are_drakes(rng: np.random.Generator) -> None:
    task = prepare(composed("+experiment=panda_pose")).task
    symbols = [ca.SX.sym(name, task.arm.n) for name in ("q", "qd", "qdd")]
    torques = peer.torques(SpatialArm(task).kinetic_energy(*symbols[:2]), *symbols)
    q, qd, qdd = rng.normal(size=(3, 1, task.arm.n))
    found = np.array(ca.Function("tau", symbols, [torques])(q[0], qd[0], qdd[0])).ravel()
    np.testing.assert_allclose(found, task.arm.inverse_dynamics(q, qd, qdd)[0], atol=1e-12)


@pytest.mark.slow
def test_a_bound_from_below(capsys: pytest.CaptureFixture[str]) -> None:
    benchmarks.main(["bound", "traj4:6"])
    out = capsys.readouterr().out
    assert re.search(r"^traj4 +6 +0\.02\S+ +0\.0\S+ % ", out, re.M)


@pytest.mark.slow
def test_scaling(capsys: pytest.CaptureFixture[str]) -> None:
    scaling.knots("sim1", sizes=(12, 24), repeats=1)
    scaling.starts("sim1", sizes=(1, 4), repeats=1)
    scaling.plans(["planar3r, line"], doublings=1, repeats=1)
    scaling.success(["fixed2"], lots=(2,))
    out = capsys.readouterr().out
    rows = re.findall(r"^ +(12|24) +(\S+) +(\S+) +(\S+) +(\S+) +(\S+)$", out, re.M)
    assert len(rows) == 2
    assert all(float(number) > 0 for row in rows for number in row)
    assert len(re.findall(r"^ +[14] +(\S+) +(\S+) +(\S+) +(\S+)$", out, re.M)) == 2
    assert re.search(r"^planar3r, line: 250 500   \d+\.\d+ \d+\.\d+   \d+\.\d+$", out, re.M)
    assert re.search(r"^ +default +1 of +1 +1 of +1 ", out, re.M)


@pytest.mark.parametrize(
    "words", [["large"], ["planner", "sim9"], ["updates", "traj9"], ["bound", "sim9"], ["scaling", "sim9"]]
)
def test_an_unknown_part_is_refused(words: list[str]) -> None:
    with pytest.raises(SystemExit, match="not one of"):
        benchmarks.main(words)
