"""Bad values are one line that names the key and what is allowed, however they come: here without the command line."""

from __future__ import annotations

from typing import Any

import pytest
from omegaconf import OmegaConf

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from pipeline.config import run as config
from tests.commands import Answer, assert_refused

VALUES = {
    "no method": (["methods=[]"], ["methods", "lsv", "pmke", "global"]),
    "method twice": (["methods=[lsv,lsv]"], ["methods", "twice"]),
    "type count": (["timing.steps=10.5"], ["timing.steps", "10.5", "whole number"]),
    "type list": (["robot.q_init=0.3"], ["robot.q_init", "list"]),
    "type table": (["timing=3"], ["timing", "3"]),
    "null": (["timing.duration=null"], ["timing.duration", "> 0"]),
    "infinite": (["timing.duration=inf"], ["timing.duration", "> 0"]),
    "nan": (["path.length=nan"], ["path.length", ">= 0"]),
    "negative duration": (["timing.duration=-1"], ["timing.duration", "-1", "> 0", "s"]),
    "zero duration": (["timing.duration=0"], ["timing.duration", "> 0"]),
    "negative steps": (["timing.steps=-5"], ["timing.steps", "-5", ">="]),
    "no steps": (["timing.steps=0"], ["timing.steps", "0", ">="]),
    "dense": (["timing.dense=[[2,1,3]]"], ["timing.dense", "from", "factor"]),
    "negative length": (["path.length=-0.1"], ["path.length", "-0.1", ">= 0"]),
    "choice": (["method.lsv.integrator=rk4"], ["method.lsv.integrator", "rk4", "euler", "heun"]),
    "horizon": (["method.pmke.horizon=0"], ["method.pmke.horizon", "0", ">= 1"]),
    "workers": (["parallel.workers=0"], ["parallel.workers", "0", ">= 1"]),
    "start out of reach": (["path.start=[3.0,0.0]"], ["start", "out of reach", "m"]),
    "start length": (["path.start=[0.3,0.1,0.0]"], ["path.start", "2 numbers"]),
    "direction": (["path.direction=[0,0]"], ["path.direction", "2 numbers"]),
    "direction in space": (["path.direction=[0,0,1]"], ["path.direction", "2 numbers"]),
    "no frame": (["robot.end_effector=hand"], ["hand", "tip"]),
    "no base": (["robot.base=floor"], ["floor"]),
    "no redundancy": (["robot.task=[x,y,z]"], ["robot.task", "3 joints", "3 task coordinates"]),
    "task word": (["robot.task=[x,w]"], ["robot.task", "w", "x, y, z"]),
    "q_init short": (["robot.q_init=[0.1,0.2]"], ["robot.q_init", "2", "3", "joint1"]),
    "q_init long": (["robot.q_init=[0.1,0.2,0.3,0.4]"], ["robot.q_init", "4", "3"]),
    "q_init word": (["robot.q_init=[0.1,0.2,up]"], ["robot.q_init[2]", "up", "number"]),
    "locked table": (["robot.locked={elbow: 0.1}"], ["robot.locked", "elbow"]),
    "urdf null": (["robot.urdf=null"], ["robot.urdf", "null"]),
    "limits length": (["limits.velocity=[1.0,2.0]"], ["limits.velocity", "2", "3"]),
    "limits sign": (["limits.velocity=-1"], ["limits.velocity", "-1", ">= 1e-09 rad/s"]),
    "limits that stop a solver": (["limits.velocity=[1e-16,5,5]"], ["limits.velocity[0] = 1e-16", ">= 1e-09 rad/s"]),
    "momentum": (["base.kind=free", "base.linear_momentum=[1e7,0,0]"], ["base.linear_momentum[0]", "<= 1e+06"]),
    "limits contradict": (["limits.lower=1.0", "limits.upper=-1.0"], ["limits.lower", "limits.upper", "joint1"]),
    "beyond doubles": (["timing.duration=1e-300"], ["timing.duration = 1e-300", "from 1e-30 to 1e+20"]),
    "beyond doubles, in a list": (["gravity=[1e300,0,0]"], ["gravity[0]", "from 1e-30 to 1e+20"]),
    "too far": (["robot.base_position=[1e16,0,0]"], ["robot.base_position[0]", "<= 1e+06"]),
    "too many turns": (["robot.q_init=[1e16,0.3,-0.7]"], ["robot.q_init[0]", "<= 10000"]),
    "too heavy": (["robot.payload=1e16"], ["robot.payload", "<= 1e+06"]),
    "too heavy a rotor": (["robot.armature=[1e16,0,0]"], ["robot.armature[0]", "<= 1e+06"]),
    "far too many steps": (["timing.steps=100000000000"], ["timing.steps"]),
}


@pytest.mark.parametrize("name", VALUES)
def test_a_bad_value_is_one_line(name: str) -> None:
    words, named = VALUES[name]
    line = OmegaConf.create({"path": {"kind": "line"}})
    values: Any = OmegaConf.to_container(OmegaConf.merge(line, OmegaConf.from_dotlist(words)))
    with pytest.raises(InputError) as raised:
        prepare(config.check(values))
    assert_refused(Answer(2, "", f"error: {raised.value}\n"), *named)
