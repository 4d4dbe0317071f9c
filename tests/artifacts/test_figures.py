"""The figures: files that are whole, lines that are the evaluation's own numbers, axes that name their units."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread
from scipy.spatial import ConvexHull

from pipeline.artifacts.figures import figures as files
from pipeline.artifacts.figures import motions as figures
from pipeline.artifacts.figures import solids
from pipeline.artifacts.figures.panels import by_joint, thin
from pipeline.artifacts.figures.stroboscopic import stroboscopic
from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.model.obstacles import Obstacles
from pipeline.model.task import PositionTask
from pipeline.path.curves import Line, direction_vector
from pipeline.path.reference import Reference
from pipeline.path.timing import RaisedCosine
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.robot.shapes import Shape, capsule
from pipeline.studies import style
from tests.reports import report_of, three_motions

NAMES = ["reference", "energy", "stroboscopic", "joints", "torques", "spectral_radius", "tracking"]
EVENT = 6.4
JUMP = 4.0  # rad, within 0.4 s of EVENT: 10 rad/s at four knots

Case = tuple[Problem, list[Evaluation]]


@pytest.fixture(scope="module")
def case(task: PositionTask) -> Case:
    """Three motions near a 0.4 m line, the first of which jumps at EVENT as at a singularity."""
    q_init = np.array([0.0, 0.327, -0.754])
    line = Line(task.value(q_init[None])[0], direction_vector(157.5, 2), 0.4)
    time = np.linspace(0.0, 10.0, 101)
    problem = Problem(task, Reference(line, RaisedCosine(10.0)), q_init, time)
    ramp = (1 - np.cos(np.pi * time / 10))[:, None] / 2
    motions = []
    for k, method in enumerate(("lsv", "pmke", "global")):
        q = q_init + ramp * np.array([0.3 + 0.1 * k, 0.4, -1.5 - 0.2 * k])
        event = EVENT if method == "lsv" else None
        if event is not None:
            q += JUMP * np.clip((time - event) / 0.4, 0.0, 1.0)[:, None]
        status = Status.SOLVED if event is None else Status.SINGULAR
        motions.append(evaluate(problem, Solution(method, Trajectory(time, q), status, event_time=event)))
    return problem, motions


def optima(motion: Evaluation, count: int) -> list[Evaluation]:
    return [replace(motion, solution=replace(motion.solution, optimum=i + 1)) for i in range(count)]


def drawn(axes: Axes, values: Array, color: str) -> bool:
    """Whether a line (or a line and its dotted rest) of that colour shows `values`."""
    lines = [line for line in axes.lines if line.get_color() == color and len(line.get_xdata()) > 1]
    found = np.concatenate([np.asarray(line.get_ydata())[i > 0 :] for i, line in enumerate(lines)])
    return found.shape == values.shape and bool(np.array_equal(found, values))


def panels(figure: Figure) -> list[Axes]:
    return [axes for axes in figure.axes if axes.lines]


def texts(figure: Figure) -> str:
    legends = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return "\n".join(legends + [text.get_text() for axes in figure.axes for text in axes.texts])


@pytest.mark.slow
def test_all_files_are_written_as_images(case: Case, tmp_path: Path) -> None:
    problem, motions = case
    folder = tmp_path / "new" / "run" / "figures"
    files.write(report_of(problem, motions), folder.parent)
    assert {file.name for file in folder.iterdir()} == {f"{name}.png" for name in NAMES}
    for file in folder.iterdir():
        height, width, _ = imread(file).shape
        assert 700 <= width <= 2500, file.name
        assert 300 <= height <= 2500, file.name
        assert imread(file)[..., :3].std() > 0.05, f"{file.name} is blank"


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 8])
def test_one_motion_and_many(case: Case, count: int) -> None:
    problem, motions = case
    for draw in (figures.energy, stroboscopic, figures.joints, figures.spectral_radius):
        figure = draw(problem, optima(motions[2], count), "run")
        FigureCanvasAgg(figure).draw()
        for axes in panels(figure):
            box = axes.get_position()
            assert min(box.width * figure.get_figwidth(), box.height * figure.get_figheight()) > 0.9, draw.__name__
        lefts = {round(axes.get_position().x0, 2) for axes in panels(figure)}
        assert len(lefts) <= 6
    assert len(panels(stroboscopic(problem, optima(motions[2], count), "run"))) == count
    assert len(panels(figures.joints(problem, optima(motions[2], count), "run"))) == 2 * count


def test_reference_is_the_timing_law(case: Case) -> None:
    problem, motions = case
    figure = figures.reference(problem, motions, "run")
    t = figure.axes[0].lines[0].get_xdata()
    assert (t[0], t[-1]) == (0.0, 10.0)
    for axes, values in zip(figure.axes, problem.reference.timing.sample(np.asarray(t), 0.4), strict=True):
        assert np.array_equal(axes.lines[0].get_ydata(), values)


def test_comparisons_draw_every_motion_in_its_colour(case: Case) -> None:
    problem, motions = case
    integral, rate = figures.energy(problem, motions, "run").axes
    (radius,) = figures.spectral_radius(problem, motions, "run").axes
    error, singular = figures.tracking(problem, motions, "run").axes
    for e in motions:
        color = style.color(e.label)
        assert drawn(integral, e.energy_integral, color)
        assert drawn(rate, e.kinetic_energy, color)
        assert drawn(radius, e.spectral_radius, color)
        assert drawn(error, np.maximum(e.tracking_error, 1e-12), color)  # nearer is rounding
        assert drawn(singular, e.singular_value, color)
    assert error.get_yscale() == "log"


def test_columns_draw_every_joint(case: Case) -> None:
    problem, motions = case
    for draw, kinds in ((figures.joints, ("q", "qd")), (figures.torques, ("tau", "power"))):
        axes = iter(draw(problem, motions, "run").axes)
        for e in motions:
            for kind in kinds:
                panel = next(axes)
                for joint in range(3):
                    assert drawn(panel, getattr(e, kind)[:, joint], style.joint_color(joint)), (e.label, kind)


def test_legend_gives_the_final_integral(case: Case) -> None:
    problem, motions = case
    rising = [np.linspace(0.0, 0.1234 + k, 101) for k in range(len(motions))]
    motions = [
        replace(e, integrals={**e.integrals, "kinetic_energy": one}) for e, one in zip(motions, rising, strict=True)
    ]
    shown = texts(figures.energy(problem, motions, "run"))
    for e in motions:
        assert f"{style.name(e.label)}\n{e.energy_integral[-1]:.4g} J s" in shown


def test_least_spectral_radius_is_marked_on_the_usable_part(case: Case) -> None:
    problem, motions = case
    figure = figures.spectral_radius(problem, motions, "run")
    marks = {tuple(np.ravel(line.get_xydata())) for line in figure.axes[0].lines if len(line.get_xdata()) == 1}
    expected = set()
    for e in motions:
        usable = e.time <= (e.solution.event_time or np.inf)
        i = int(np.argmin(e.spectral_radius[usable]))
        expected.add((e.time[i], e.spectral_radius[i]))
        assert f"min {e.spectral_radius[i]:.4g}\nat {e.time[i]:.2f} s" in texts(figure)
    assert marks == expected


def test_singularity_is_marked_and_does_not_flatten_the_rest(case: Case) -> None:
    problem, motions = case
    figure = figures.joints(problem, motions, "run")
    velocity = figure.axes[1]
    assert any(list(line.get_xdata()) == [EVENT, EVENT] for line in velocity.lines)
    peak = np.abs(motions[0].qd).max()
    assert peak > 9  # the jump is there
    assert np.abs(velocity.get_ylim()).max() < 2
    assert f"singular at {EVENT:.2f} s\npeak of {peak:.3g} rad/s cut off" in [t.get_text() for t in velocity.texts]
    assert "singular" not in texts(figures.joints(problem, motions[1:], "run"))
    for e, axes in zip(motions[1:], figure.axes[3::2], strict=True):
        low, high = axes.get_ylim()
        assert low < e.qd.min()
        assert high > e.qd.max()
        assert (low, high) == velocity.get_ylim()


def test_stroboscopic_shows_the_poses_on_equal_scales(case: Case) -> None:
    problem, motions = case
    axes = panels(stroboscopic(problem, motions, "run"))
    for e, panel in zip(motions, axes, strict=True):
        poses = [line for line in panel.lines if line.get_marker() == "o" and len(line.get_xdata()) == 4]
        assert 15 <= len(poses) <= 20
        for pose, k in ((poses[0], 0), (poses[-1], -1)):
            assert np.array_equal(np.asarray(pose.get_xydata()), e.skeleton[k, :, :2])
        assert any(np.array_equal(line.get_xydata(), e.position[:, :2]) for line in panel.lines)
        assert panel.get_aspect() == 1.0
        assert (panel.get_xlim(), panel.get_ylim()) == (axes[0].get_xlim(), axes[0].get_ylim())


def test_spatial_motion_is_shown_in_space(case: Case) -> None:
    problem, motions = case
    height = np.linspace(0, 0.2, 4)
    raised = [replace(e, skeleton=e.skeleton + np.outer(height, [0, 0, 1.0])) for e in motions]
    figure = stroboscopic(problem, raised, "run")
    FigureCanvasAgg(figure).draw()
    assert [axes.name for axes in figure.axes[:3]] == ["3d"] * 3
    assert figure.axes[0].get_zlabel() == "z [m]"
    low, high = figure.axes[0].get_zlim()
    assert low < 0 < 0.2 < high


def test_every_axis_has_its_unit_and_every_figure_its_name(case: Case) -> None:
    problem, motions = case
    for name in NAMES:
        figure = files.FIGURES[name](problem, motions, "run 7")
        assert figure is not None
        assert "run 7" in figure.get_suptitle()
        labels = [axes.get_ylabel() for axes in figure.axes] + [axes.get_xlabel() for axes in figure.axes]
        labels = [label for label in labels if label]
        assert len(labels) >= 2
        for label in labels:
            assert re.search(r"\[.+\]$", label), f"{name}: {label}"
    assert "[rad/s]" in figures.joints(problem, motions, "").axes[1].get_ylabel()
    assert "[N m]" in figures.torques(problem, motions, "").axes[0].get_ylabel()


def test_long_motions_are_thinned_to_their_ends(case: Case) -> None:
    time = np.linspace(0.0, 10.0, 50_001)
    keep = thin(time)
    assert len(keep) <= 1001
    assert (keep[0], keep[-1]) == (0, 50_000)
    assert np.all(np.diff(keep) > 0)


def test_a_gap_in_the_numbers_does_not_stop_the_figures(case: Case) -> None:
    problem, motions = case
    qd = motions[1].qd.copy()
    qd[50:] = np.nan
    broken = replace(motions[1], qd=qd)
    FigureCanvasAgg(figures.joints(problem, [broken], "run")).draw()


def test_nothing_is_left_behind_by_a_failure(case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, motions = case
    folder = tmp_path / "figures"
    folder.mkdir()
    (folder / "reference.png").write_bytes(b"of an earlier run")

    def full(self: Figure, file: Path, **options: object) -> None:
        Path(file).write_bytes(b"half a pict")
        raise OSError("no space left on device")

    monkeypatch.setattr(Figure, "savefig", full)
    with pytest.raises(OSError, match="no space"):
        files.write(report_of(problem, motions), tmp_path)
    assert [file.name for file in folder.iterdir()] == ["reference.png"]
    assert (folder / "reference.png").read_bytes() == b"of an earlier run"


SOLIDS = [
    Shape("ball", "sphere", (0.05,), (0.3, 0.2, 0.1)),
    Shape("box", "box", (0.1, 0.2, 0.3), (0.3, 0.2, 0.1), (0.3, -0.2, 0.5)),
    capsule("rod", np.array([0.1, 0.2, 0.0]), np.array([0.3, 0.2, 0.4]), 0.03),
    Shape("can", "cylinder", (0.05, 0.2), (0.3, 0.2, 0.1), (0.3, -0.2, 0.5)),
]


@pytest.mark.parametrize(("solid", "volume"), [*zip(SOLIDS, [5.236e-4, 6e-3, 1.3776e-3, 1.5708e-3], strict=True)])
def test_an_obstacle_is_as_large_as_it_is(solid: Shape, volume: float) -> None:
    hull = ConvexHull(solids.surface(solid))
    assert hull.volume == pytest.approx(volume, rel=0.05)
    np.testing.assert_allclose((hull.min_bound + hull.max_bound) / 2, solid.position, atol=1e-3)


def test_obstacles_are_drawn(case: Case) -> None:
    """A planar motion shows their outlines, one in space the solids."""
    problem, motions = case
    among = replace(problem, obstacles=Obstacles(tuple(SOLIDS), 0.02))
    flat = stroboscopic(among, motions[:1], "run")
    assert len(flat.axes[0].patches) == len(SOLIDS)
    assert "Obstacle" in texts(flat)
    assert "Obstacle" not in texts(stroboscopic(problem, motions[:1], "run"))
    lifted = replace(motions[0], skeleton=motions[0].skeleton + 0.1 * np.arange(4)[:, None] * np.eye(3)[2])
    space = stroboscopic(among, [lifted], "run")
    assert len(space.axes[0].collections) == len(SOLIDS)


def test_limits_are_drawn_with_an_entry_and_told_where_they_are_far() -> None:
    """joint1 exceeds 0.1 rad/s, joint2 stays far below 9."""
    report = three_motions()
    figure = figures.joints(report.motions.problem, report.motions.evaluations, "run")
    velocity = figure.axes[1]
    levels = {
        round(float(np.ravel(line.get_ydata())[0]), 6) for line in velocity.lines if len(set(line.get_ydata())) == 1
    }
    assert {-0.1, 0.1} <= levels
    assert not {-9.0, 9.0} & levels
    assert any("limits from 9 on, outside" in text.get_text() for text in velocity.texts)
    named = [text.get_text() for text in figure.legends[0].texts]
    assert named == [*report.motions.problem.task.arm.description.actuated, "Limits"]


@pytest.mark.parametrize("name", ["q", "panda_joint", "left_shoulder_lift_joint"])
def test_names_of_joints_are_whole(case: Case, name: str) -> None:
    """However long they are."""
    shown = by_joint("run", [f"{name}{k}" for k in range(3)], case[1][:1], ("q", "rad", lambda e: e.q, None))
    shown.draw_without_rendering()
    inside = shown.legends[0].get_window_extent()
    assert inside.x0 >= 0
    assert inside.x1 <= shown.bbox.x1


def test_the_clearance_stands_beside_its_margin() -> None:
    report = three_motions()
    problem, motions = report.motions.problem, report.motions.evaluations
    figure = figures.clearance(problem, motions, "run")
    assert figure is not None
    (axes,) = figure.axes
    for e in motions:
        assert drawn(axes, e.clearance, style.color(e.label))
    assert drawn(axes, np.array([0.02, 0.02]), "#C53030")
    assert figures.clearance(replace(problem, obstacles=None), motions, "run") is None


def test_styles_are_those_of_methods_whatever_their_order() -> None:
    assert style.dashes("lsv") == "-"
    assert len({style.dashes(name) for name in ("lsv", "inertia_weighted", "pmke", "global")}) == 4
    assert style.dashes("global 2") == style.dashes("global")
