"""Texts of robots with every element that loaders read, and their mutations."""

from __future__ import annotations

import copy
from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np

__all__ = ["MJCF", "URDF", "mutated"]

URDF = """<?xml version="1.0"?>
<robot name="walker">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base">
    <inertial><origin xyz="0 0 0.1" rpy="0 0 0.3"/><mass value="4"/>
      <inertia ixx="0.05" ixy="0.001" ixz="0" iyy="0.06" iyz="0" izz="0.07"/></inertial>
    <visual><geometry><box size="0.4 0.2 0.1"/></geometry><material name="grey"/></visual>
    <collision><origin xyz="0 0 0.05"/><geometry><box size="0.4 0.2 0.1"/></geometry></collision>
    <collision name="nose"><origin xyz="0.2 0 0"/><geometry><sphere radius="0.05"/></geometry></collision>
  </link>
  <link name="thigh">
    <inertial><mass value="0.5"/><inertia ixx="0.002" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.0005"/></inertial>
    <collision><origin xyz="0 0 -0.1"/><geometry><cylinder radius="0.02" length="0.2"/></geometry></collision>
  </link>
  <link name="shin">
    <inertial><origin xyz="0 0 -0.1"/><mass value="0.2"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.0002"/></inertial>
    <collision><origin xyz="0 0 -0.2"/><geometry><capsule radius="0.02" length="0.1"/></geometry></collision>
  </link>
  <link name="cover"><inertial><mass value="0.1"/>
    <inertia ixx="0.0001" ixy="0" ixz="0" iyy="0.0001" iyz="0" izz="0.0001"/></inertial></link>
  <link name="tail"><inertial><mass value="0.3"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>
  <link name="rotor"><inertial><mass value="0.1"/>
    <inertia ixx="0.0001" ixy="0" ixz="0" iyy="0.0001" iyz="0" izz="0.0001"/></inertial></link>
  <joint name="hip" type="revolute"><parent link="base"/><child link="thigh"/><origin xyz="0 0.1 0" rpy="0 0.2 0"/>
    <axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5" effort="30" velocity="10"/><dynamics damping="0.1" friction="0.05"/>
  </joint>
  <joint name="knee" type="continuous"><parent link="thigh"/><child link="shin"/><origin xyz="0 0 -0.2"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="glue" type="fixed"><parent link="base"/><child link="cover"/><origin xyz="-0.1 0 0.1"/></joint>
  <joint name="wag" type="prismatic"><parent link="base"/><child link="tail"/><axis xyz="1 0 0"/>
    <limit lower="-0.1" upper="0.2" effort="5" velocity="1"/></joint>
  <joint name="spin" type="revolute"><parent link="base"/><child link="rotor"/><axis xyz="0 0 1"/>
    <limit lower="-9" upper="9" effort="1" velocity="1"/><mimic joint="hip" multiplier="2" offset="0.1"/></joint>
  <transmission name="drive"><type>transmission_interface/SimpleTransmission</type><joint name="hip"/>
    <actuator name="motor"><mechanicalReduction>6</mechanicalReduction></actuator></transmission>
</robot>
"""

MJCF = """<mujoco model="walker">
  <compiler angle="radian"/><option timestep="0.01" gravity="0 0 -9.81"/>
  <default><joint damping="0.1" armature="0.01"/><geom friction="0.8 0.1 0.1"/></default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="base" pos="0 0 0.5"><freejoint name="root"/>
      <geom name="trunk" type="box" size="0.2 0.1 0.05" mass="4"/>
      <body name="thigh" pos="0 0.1 0"><joint name="hip" axis="0 1 0" range="-1.5 1.5" limited="true"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.5"/>
        <body name="shin" pos="0 0 -0.2"><joint name="knee" axis="0 1 0" stiffness="1" springref="0.1"/>
          <geom type="sphere" pos="0 0 -0.2" size="0.03" mass="0.2"/><site name="foot" pos="0 0 -0.2"/></body></body>
      <body name="tail" pos="-0.2 0 0"><joint name="wag" type="slide" axis="1 0 0" frictionloss="0.1"/>
        <inertial pos="0 0 0" mass="0.3" diaginertia="0.001 0.001 0.001"/></body>
      <body name="head" pos="0.2 0 0"><joint name="neck" type="ball"/><geom type="ellipsoid" size="0.05 0.04 0.03"/></body>
    </body>
  </worldbody>
  <contact><exclude body1="base" body2="thigh"/></contact>
  <equality><joint joint1="knee" joint2="hip" polycoef="0 1 0 0 0"/></equality>
  <actuator><motor name="m" joint="hip" gear="5" ctrlrange="-1 1" ctrllimited="true"/>
    <position name="p" joint="knee" kp="10"/></actuator>
  <keyframe><key qpos="0 0 0.4 1 0 0 0 0.1 0.1 0 1 0 0 0"/></keyframe>
</mujoco>
"""

VALUES = (
    *("", "0", "-1", "1e300", "-1e300", "1e-300", "1e400", "nan", "inf", "-inf", "1_000", "\u0661", "0x10", "1,5"),
    *(
        "0 0 0",
        "1 2",
        "nan nan nan",
        "1e200 1e200 1e200",
        "0 0 0 0",
        "9" * 400,
        "\u00e9\u4e2d",
        "a b",
        "../../etc/passwd",
    ),
    *("base", "world", "thigh", "hip", "knee", "revolute", "floating", "planar", "spherical", "ball", "free"),
)
TAGS = ("link", "joint", "robot", "collision", "inertial", "geom", "body", "nonsense", "mimic", "limit", "axis", "mass")


def mutated(text: str, rng: np.random.Generator) -> str:
    """The text of a robot with one to four changes.

    Args:
        text: of the robot.
        rng: of the changes.

    Returns:
        The other text, seldom no XML.
    """
    root = ElementTree.fromstring(text)
    for _ in range(int(rng.integers(1, 5))):
        CHANGES[int(rng.integers(len(CHANGES)))](root, rng)
    out = ElementTree.tostring(root, encoding="unicode")
    if rng.random() < 0.05:
        return out[: int(rng.integers(len(out)))]
    if rng.random() < 0.05:
        at = int(rng.integers(len(out)))
        return out[:at] + str(rng.choice(["<", ">", "&", '"', "<!--", "\u00e9", "]]>", "&#0;"])) + out[at:]
    return out


def _inside(root: ElementTree.Element, rng: np.random.Generator) -> tuple[ElementTree.Element, ElementTree.Element]:
    """(parent, child): a random element that is not the root."""
    pairs = [(parent, child) for parent in root.iter() for child in parent] or [(root, root)]
    return pairs[int(rng.integers(len(pairs)))]


def _lose(root: ElementTree.Element, rng: np.random.Generator) -> None:
    parent, child = _inside(root, rng)
    if child is not root:
        parent.remove(child)


def _double(root: ElementTree.Element, rng: np.random.Generator) -> None:
    parent, child = _inside(root, rng)
    parent.append(copy.deepcopy(child))


def _move(root: ElementTree.Element, rng: np.random.Generator) -> None:
    _inside(root, rng)[1].append(copy.deepcopy(_inside(root, rng)[1]))


def _rename(root: ElementTree.Element, rng: np.random.Generator) -> None:
    _inside(root, rng)[1].tag = str(rng.choice(TAGS))


def _lose_attribute(root: ElementTree.Element, rng: np.random.Generator) -> None:
    child = _inside(root, rng)[1]
    if child.attrib:
        del child.attrib[str(rng.choice(list(child.attrib)))]


def _value(root: ElementTree.Element, rng: np.random.Generator) -> None:
    child = _inside(root, rng)[1]
    if child.attrib:
        child.attrib[str(rng.choice(list(child.attrib)))] = str(rng.choice(VALUES))


def _borrow(root: ElementTree.Element, rng: np.random.Generator) -> None:
    """A value of another element: names that exist, so joints form cycles and links meet twice."""
    child, other = _inside(root, rng)[1], _inside(root, rng)[1]
    if child.attrib and other.attrib:
        child.attrib[str(rng.choice(list(child.attrib)))] = other.attrib[str(rng.choice(list(other.attrib)))]


def _scale(root: ElementTree.Element, rng: np.random.Generator) -> None:
    """Numbers times a power of ten, or less than nothing."""
    child = _inside(root, rng)[1]
    for key, value in child.attrib.items():
        try:
            numbers = [float(word) for word in value.split()]
        except ValueError:
            continue
        factor = float(rng.choice([-1.0, 0.0, 10.0 ** rng.uniform(-12.0, 12.0)]))
        child.attrib[key] = " ".join(repr(factor * x) for x in numbers)


CHANGES: tuple[Callable[[ElementTree.Element, np.random.Generator], None], ...] = (
    *(_lose, _double, _move, _rename, _lose_attribute),
    *(_value, _value, _borrow, _borrow, _scale, _scale),
)
