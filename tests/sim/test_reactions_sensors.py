"""Reactions of joints against the force and torque sensors of MuJoCo."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo

SENSORS = """
<mujoco>
  <option timestep="1e-5"/>
  <worldbody>
    <body name="a" pos="0 0 1">
      <joint name="a" type="hinge" axis="0.6 0 0.8" damping="0.2"/>
      <geom type="box" size="0.2 0.05 0.04" pos="0.2 0 0" mass="2"/>
      <site name="a" pos="0 0 0"/>
      <body name="b" pos="0.4 0 0">
        <joint name="b" type="hinge" axis="0 1 0" stiffness="4" armature="0.05"/>
        <geom type="box" size="0.15 0.03 0.06" pos="0.15 0.02 0" mass="1"/>
        <site name="b" pos="0 0 0"/>
        <body name="c" pos="0.3 0 0">
          <joint name="c" type="slide" axis="1 0 0"/>
          <geom type="sphere" size="0.05" pos="0.05 0 0.02" mass="0.5"/>
          <site name="c" pos="0 0 0"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="b"/><motor joint="c"/></actuator>
  <sensor>
    <force site="a"/><torque site="a"/><force site="b"/><torque site="b"/><force site="c"/><torque site="c"/>
  </sensor>
</mujoco>
"""


def test_against_the_force_and_torque_sensors_of_mujoco() -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(SENSORS)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = (0.5, -0.7, 0.1), (1.5, -2.0, 0.3), (2.0, -3.0)
    mujoco.mj_forward(model, data)
    sensed = data.sensordata.reshape(3, 2, 3)
    errors = []
    for h in (2e-4, 1e-4):
        sim = dojo.Simulator(dojo.load_mjcf(SENSORS), time_step=h, tolerance=1e-12)
        r = sim.reactions(sim.state_from_velocity(data.qpos, data.qvel), data.ctrl, frame="body")
        # the site of the slide stays in its body, as our joint point does
        errors.append(max(np.abs(r.force - sensed[:, 0]).max(), np.abs(r.torque - sensed[:, 1]).max()))
    assert errors[1] < 5e-3 * np.abs(sensed).max() and errors[1] < 0.6 * errors[0]
