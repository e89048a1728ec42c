"""Files with thousands of links are read in a time that grows as they do."""

from __future__ import annotations

import gc
import time
from pathlib import Path

import pytest

import dojo_opt as dojo
from support.urdf_files import inertial, joint, link, write

LINKS, FEWER = 1200, 300
LINEAR = LINKS / FEWER
TRIES = 4  # a slow loader fails in each of them, a busy machine does not


def loaded(folder: Path, links: int, above) -> tuple[float, dojo.Mechanism, dojo.Simulator]:
    """Processor time [s] to load a file with this number of links, and the mechanism and simulator from it."""
    names = [f"l{k}" for k in range(links)]
    joints = [joint(f"j{k}", names[above(k)], names[k]) for k in range(1, links)]
    path = write(folder, *(link(name, inertial()) for name in names), *joints)
    gc.disable()  # its time is that of all objects of the process
    try:
        begin = time.process_time()
        mech = dojo.load_urdf(path, ground=False)
        sim = dojo.Simulator(mech, time_step=0.01)
        return time.process_time() - begin, mech, sim
    finally:
        gc.enable()


@pytest.mark.slow
@pytest.mark.parametrize("above", [lambda k: k - 1, lambda k: 0, lambda k: k // 2], ids=["chain", "star", "tree"])
def test_the_time_of_loading_grows_as_the_number_of_links(tmp_path: Path, above) -> None:
    growth = []
    while not growth or (growth[-1] > 2.0 * LINEAR and len(growth) < TRIES):
        few, _, _ = loaded(tmp_path, FEWER, above)
        many, mech, sim = loaded(tmp_path, LINKS, above)
        growth.append(many / few)
    assert growth[-1] < 2.0 * LINEAR, growth  # 2.5 times LINEAR or more when every joint was looked up in a list
    assert (sim.nbody, sim.nv) == (LINKS, LINKS + 5)
    ends = [mech.v_slice(name).stop for name in mech.joint_names]
    assert ends == list(range(6, LINKS + 6))
