"""Elements and attributes of a URDF file that are not read, for the report."""

from __future__ import annotations

from collections import Counter

from sim.io.urdf.xml import Element

_JOINT = ("origin", "parent", "child", "link1", "link2", "axis", "mimic", "dynamics", "limit")
# by element those inside that are read
_READ = {
    "robot": ("link", "joint", "loop_joint"),
    "link": ("inertial", "collision", "contact"),
    "inertial": ("origin", "mass", "inertia"),
    "collision": ("origin", "geometry"),
    "contact": ("lateral_friction", "restitution", "rolling_friction", "spinning_friction"),
    "joint": _JOINT,
    "loop_joint": _JOINT,
    "dynamics": (),
    "limit": (),
}
# elements for pictures and drivers, which do nothing to the motion
_IDLE = {
    *(("robot", "material"), ("link", "visual"), ("collision", "material")),
    *(("joint", "calibration"), ("joint", "safety_controller")),
}
_ATTRIBUTES = {"dynamics": {"damping", "friction"}, "limit": {"lower", "upper", "effort", "velocity"}}


def unread(element: Element, path: str = "") -> Counter[str]:
    """What is not read inside an element, and how often it is there.

    Args:
        element: the element.
        path: those around it, as "<link><collision>".

    Returns:
        The number by place: "<joint><actuator>" of an element, "<joint><dynamics armature>" of an attribute.
    """
    found: Counter[str] = Counter()
    for child in element.children:
        place, own = f"{path}<{child.tag}>", child.attributes.keys()
        if child.tag in _READ[element.tag]:
            found.update(f"{place[:-1]} {name}>" for name in sorted(own - _ATTRIBUTES.get(child.tag, own)))
            found.update(unread(child, place) if child.tag in _READ else {})
        elif (element.tag, child.tag) not in _IDLE:
            found[place] += 1
    return found
