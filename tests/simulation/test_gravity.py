"""Gravity on a chain of bodies: MuJoCo's own, for any joints."""

import mujoco
import numpy as np
import pytest

from hydroid.simulation.gravity import hold, load_links, make_links

TREE = """
<mujoco>
  <option gravity="0.3 -2 -9.5"/>
  <compiler angle="radian"/>
  <worldbody>
    <body pos="0.1 0.2 0.5" quat="0.9 0.1 -0.3 0.2">
      <joint axis="0 0 1"/>
      <inertial pos="0.1 0 0.2" mass="30" diaginertia="1 1 1"/>
      <body pos="0.2 0 0.4" euler="0.3 -0.2 1">
        <joint axis="0.2 -1 0.5" pos="0.1 -0.3 0.2" ref="0.4"/>
        <inertial pos="1 0.1 0" mass="20" diaginertia="1 1 1"/>
        <body pos="1.5 0 0">
          <joint type="slide" axis="1 0.1 0" ref="-0.2"/>
          <inertial pos="0.5 0 0.1" mass="10" diaginertia="1 1 1"/>
          <body pos="0.8 0 0"><joint axis="0 -1 0"/>
            <inertial pos="0.2 0 0" mass="5" diaginertia="1 1 1"/></body>
        </body>
        <body pos="0 0.5 0" euler="1 0 0"><joint axis="1 0 0"/>
          <inertial pos="0 0.4 0.3" mass="8" diaginertia="1 1 1"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize("flag", ["", "<flag gravity='disable'/>"])
def test_it_is_mujocos_in_any_pose(flag):
    model = mujoco.MjModel.from_xml_string(
        TREE.replace("<comp", f"<option>{flag}</option><comp")
    )
    data = mujoco.MjData(model)
    links = make_links(model).view(np.recarray)
    load_links(links, model.body_mass, model.body_ipos)
    poses = np.random.default_rng(1).uniform(-3, 3, (20, model.nv))
    # a joint that stands still, and one that alone has moved
    poses[10:] = poses[10]
    poses[11:, 2] += 0.1
    expected, held = np.empty(model.nv), np.empty(model.nv)
    for pose in poses:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_rne(model, data, 0, expected)
        hold(links, pose, held)
        np.testing.assert_allclose(held, expected, rtol=0, atol=1e-12 * 700)
