"""`make pictures`: the README's pictures from the runs of the reproduction. Needs the viewer's system libraries."""

from __future__ import annotations

import io
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

from PIL import Image

from pipeline.reproduce.__main__ import FOLDER
from pipeline.reproduce.drawings import energy_integrals
from pipeline.reproduce.results import Results

DOCS = Path(__file__).resolve().parent
WIDTH, COLORS = 1200, 128


def small(image: Image.Image, file: Path) -> None:
    """Save at most WIDTH pixels wide, with a palette: a picture in a repository stays small."""
    image = image.convert("RGB")
    if image.width > WIDTH:
        image = image.resize((WIDTH, round(image.height * WIDTH / image.width)), Image.Resampling.LANCZOS)
    image.quantize(COLORS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(file, optimize=True)
    print(f"{file.name}: {file.stat().st_size // 1024} kB")


def screenshot(recording: Path, at: float) -> Image.Image:
    """What the viewer shows of a recording at time `at` [s]."""
    from rerun.experimental import ViewerClient

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "rerun", "--headless", "--bind", "127.0.0.1", "--port", str(port)]
    viewer = subprocess.Popen(
        [*command, "--hide-welcome-screen"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        for _ in range(100):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.1)
        client = ViewerClient(f"rerun+http://127.0.0.1:{port}/proxy")
        client.open([str(recording)])
        while client.get_state().loading or not client.get_state().views:
            time.sleep(0.2)
        client.set_time("time", duration=at, play_state="paused")
        before = b""
        while (now := client.take_screenshot(None)) != before:
            before = now
            time.sleep(0.5)
        return Image.open(io.BytesIO(now))
    finally:
        os.killpg(viewer.pid, signal.SIGTERM)  # the command is a wrapper: the viewer is its child
        viewer.wait()


def main() -> None:
    # Finished runs are taken as they are: after `make reproduce` this draws nothing anew.
    subprocess.run([sys.executable, "-m", "pipeline.reproduce", "--folder", str(FOLDER)], check=True)
    runs = FOLDER / "runs"
    names = ("traj1", "traj2", "traj3", "traj4")
    energies = energy_integrals(
        [Results(runs / name) for name in names], ("pmke", "lsv", "global"), "PMKE paper, Fig. 3"
    )
    content = io.BytesIO()
    energies.savefig(content, format="png", dpi=120)
    small(Image.open(content), DOCS / "energy.png")
    small(Image.open(runs / "traj3" / "figures" / "stroboscopic.png"), DOCS / "stroboscopic.png")
    small(Image.open(runs / "pareto" / "figures" / "front.png"), DOCS / "front.png")
    floating = FOLDER.parent / "floating3r"
    run = [sys.executable, "-m", "pipeline", "+experiment=floating3r", f"hydra.run.dir={floating}"]
    subprocess.run(run, check=True)
    small(Image.open(floating / "figures" / "stroboscopic.png"), DOCS / "floating.png")
    tube = FOLDER.parent / "traj3_tube"
    words = ["path.exact=false", "path.tolerance=1e-2", "methods=[pareto]", "method.pareto.steps=5"]
    words += ["method.pareto.objectives=[path_tolerance,kinetic_energy]", "name=traj3_tube", f"hydra.run.dir={tube}"]
    subprocess.run([sys.executable, "-m", "pipeline", "+experiment=traj3_sendable", *words], check=True)
    small(Image.open(tube / "figures" / "front.png"), DOCS / "tube.png")
    small(screenshot(runs / "traj3" / "recording.rrd", 4.0), DOCS / "recording.png")


if __name__ == "__main__":
    main()
