"""Files with thousands of links are read in a time that grows as they do."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

import dojo_opt as dojo
from support.urdf_files import inertial, joint, link, write

LINKS = 4000


@pytest.mark.parametrize("above", [lambda k: k - 1, lambda k: 0, lambda k: k // 2], ids=["chain", "star", "tree"])
def test_thousands_of_links_load_in_seconds(tmp_path: Path, above) -> None:
    names = [f"l{k}" for k in range(LINKS)]
    joints = [joint(f"j{k}", names[above(k)], names[k]) for k in range(1, LINKS)]
    path = write(tmp_path, *(link(name, inertial()) for name in names), *joints)
    begin = time.process_time()
    mech = dojo.load_urdf(path, ground=False)
    sim = dojo.Simulator(mech, time_step=0.01)
    assert time.process_time() - begin < 20.0  # 3 s on a quiet machine; 38 s when every joint was looked up in a list
    assert (sim.nbody, sim.nv) == (LINKS, LINKS + 5)
    ends = [mech.v_slice(name).stop for name in mech.joint_names]
    assert ends == list(range(6, LINKS + 6))
