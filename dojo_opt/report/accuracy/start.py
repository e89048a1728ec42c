"""Where a robot starts from when nobody says: random, but the same for everybody."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.bodies import rotated
from sim.mechanism import Mechanism
from sim.simulator import Simulator

Floats = NDArray[np.float64]


def start(mechanism: Mechanism) -> tuple[Floats, Floats]:
    """(q, v): the neutral pose, joints turned by about 0.2 rad within their limits and moving at 1 rad/s, a floating
    base at 0.3 m/s and 0.5 rad/s, its lowest contact 2 cm above its ground. The same for everybody.
    """
    sim = Simulator(mechanism, time_step=1e-3)
    rng = np.random.default_rng(0)
    dx, neutral = np.zeros(sim.ndx), np.asarray(mechanism.neutral, dtype=np.float64)
    v = np.zeros(sim.nv)
    for joint in mechanism.joints:
        at, floats = mechanism.v_slice(joint.name), joint.kind == "floating"
        n = at.stop - at.start
        dx[at] = rng.normal(size=n) * (np.repeat([0.0, 0.1], 3) if floats else 0.2)
        v[at] = rng.normal(size=n) * (np.repeat([0.3, 0.5], 3) if floats else 1.0)
    q = np.array(neutral)
    for share in (1.0, 0.5, 0.25, 0.1, 0.0):
        q = _inside(sim, sim.integrate(np.concatenate([neutral, np.zeros(sim.nv)]), share * dx)[: sim.nq])
        lowest = min(gaps(sim, q), default=0.02)
        if mechanism.joints[0].kind == "floating":
            q[2] += 0.02 - lowest
            return q, v
        if lowest >= 0.0:
            break
    return q, v


def _inside(sim: Simulator, q: Floats) -> Floats:
    """Coordinates moved into their limits, a twentieth of the range from either end."""
    model, out = sim.model, np.array(q)
    for dof in np.unique(model.limit_dof):
        low, high = -np.inf, np.inf
        for k in np.flatnonzero(model.limit_dof == dof):
            bound = model.limit_bound[k]
            low, high = (bound, high) if model.limit_sign[k] > 0 else (low, bound)
        margin = 0.05 * (high - low) if np.isfinite(high - low) else 0.05
        a = model.dof_qadr[dof]
        out[a] = np.clip(out[a], low + margin, high - margin)
    return out


def gaps(sim: Simulator, q: Floats) -> list[float]:
    """Distance of every contact from its ground [m]."""
    z, model = sim.bodies(q, np.zeros(sim.nv)), sim.model
    out = []
    for c, body in enumerate(model.contact_body):
        centre = z[body, :3] + rotated(z[body, 6:10], model.contact_point[c])
        out.append(float(centre @ model.contact_frame[c, :3] - model.contact_radius[c] - model.contact_height[c]))
    return out
