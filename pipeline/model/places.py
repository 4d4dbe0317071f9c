"""Where an arm's links are, without their shapes: a plant of its own, cheap to make."""

from __future__ import annotations

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.stack import assemble


class Places:
    """Where the links that have shapes are."""

    def __init__(self, arm: Arm) -> None:
        description = arm.description
        self.plant = MultibodyPlant(0.0)
        model, _ = assemble(self.plant, Parser(self.plant), description, arm.mounting)
        self.plant.Finalize()
        links = dict.fromkeys(str(shape.frame) for shape in description.collision)
        self.bodies = {link: self.plant.GetBodyByName(description.drake_name(link), model) for link in links}
        self.context = self.plant.CreateDefaultContext()

    def __call__(self, q: Array) -> dict[str, tuple[Array, Array]]:
        """Rotation (3, 3) and position (3,) [m] of each at q (n,)."""
        self.plant.SetPositions(self.context, q)
        poses = {link: body.EvalPoseInWorld(self.context) for link, body in self.bodies.items()}
        return {link: (pose.rotation().matrix(), pose.translation()) for link, pose in poses.items()}
