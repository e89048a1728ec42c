"""The work of the joints in a step: none, to O(h^3), in a motion that time steps can follow.

What a joint transmits, less its springs, dampers, inputs and stops, acts along none of the directions S2 in which it
lets bodies move at configuration 2. Over the intervals 1-2 and 2-3 the bodies move along arcs, and where they turn far
these lead off the directions: there, equations of a step have solutions in which joints and impulses of contacts wind
one another up, to any energy, beside the solution that goes on with the motion, or where a step so long has none.

    work = sum over bodies of  w.(V + V')/2  -  sum over dofs of  S2^T (subtree sums of w) (v + v')/2

w, the wrench that joints exert on a body, is what its momenta leave over: work.wrench at the solution. Everything else
that acts, contacts, inputs, loops, is in neither sum; force-free bodies have w = 0 however fast they tumble.
"""

from __future__ import annotations

from sim.elimination import dot_six
from sim.energy import momentum_velocity
from sim.model import Model, Vector
from sim.rotation import cross
from sim.work import Work
from solvers.jit import kernel

# of the mean of the kinetic energies before and after. Where bodies speed up, it is at most .35 in solutions that go on
# with the motion, of 20,000 random extreme states and of falls of 27 robots, and at least 1.6 in the others
_SHARE = 1.0


@kernel
def joint_work(model: Model, work: Work, h: float, v: Vector) -> float:
    """Work of the joints in the solved step [J]."""
    total = 0.0
    o = work.origin
    for i in range(model.body_parent.shape[0]):
        w, x = work.wrench[i], work.pos2[i]
        m = cross(x[0] - o[0], x[1] - o[1], x[2] - o[2], w[0], w[1], w[2])
        for k in range(3):
            total += w[k] * (work.move_in[i, k] + work.move[i, k]) / h
            total += (w[3 + k] - m[k]) * 2.0 * (work.turn_in[i, 1 + k] + work.turn[i, 1 + k]) / h
    for d in range(v.shape[0]):
        total -= dot_six(work.S2[d], work.subtree[model.dof_body[d]]) * (v[d] + work.nu[d])
    return 0.5 * total


@kernel
def joints_gained(model: Model, work: Work, h: float, v: Vector) -> bool:
    """Whether bodies got faster in the solved step, by energy that its joints gave."""
    before = 0.5 * momentum_velocity(model, work, h, work.move_in, work.turn_in, v)
    after = 0.5 * momentum_velocity(model, work, h, work.move, work.turn, work.nu)
    return after > before and joint_work(model, work, h, v) > _SHARE * 0.5 * (before + after)
