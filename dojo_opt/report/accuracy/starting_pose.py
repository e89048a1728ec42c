"""The default starting pose of a robot: random, but the same in every run."""

from __future__ import annotations

import numpy as np

from sim.dynamics.maximal_energy import rotated
from sim.mechanism.mechanism import Mechanism
from sim.model.state_columns import BodyState
from sim.simulator.simulator import Simulator
from solvers.types import Floats

_ABOVE = 0.02  # [m] above the ground
_SHIFT = 1e-3  # [m] trial displacement of a base
_STEEP = 0.1  # least rise of the lowest contact over the way of the base


def start(mechanism: Mechanism) -> tuple[Floats, Floats]:
    """(q, v): the neutral pose, joints turned by about 0.2 rad within their limits and moving at 1 rad/s, a floating
    base at 0.3 m/s and 0.5 rad/s; a base that translates has its lowest contact 2 cm above its ground. The same for
    everybody.
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
        raised = _raised(sim, q)
        if raised is not None:
            return raised, v
        if min(gaps(sim, q), default=0.0) >= 0.0:
            break
    return q, v


def _raised(sim: Simulator, q: Floats) -> Floats | None:
    """q with the base moved along the translation that raises its lowest contact most; None where none of them does."""
    lowest = min(gaps(sim, q), default=_ABOVE)
    out, moves = np.array(q), int(sim.model.joint_ntrans[0])
    if sim.ncontact == 0 or moves == 0:
        return out if moves == 3 else None
    slopes = [(min(gaps(sim, q + _SHIFT * e)) - lowest) / _SHIFT for e in np.eye(len(q))[:moves]]
    best = int(np.argmax(np.abs(slopes)))
    if abs(slopes[best]) < _STEEP:
        return None
    out[best] += (_ABOVE - lowest) / slopes[best]
    return out if np.allclose(out, _inside(sim, out)) else None


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
    z, model = sim.body_states(q, np.zeros(sim.nv)), sim.model
    out = []
    for c, body in enumerate(model.contact_body):
        center = z[body, BodyState.POSITION] + rotated(z[body, BodyState.QUATERNION], model.contact_point[c])
        out.append(float(center @ model.contact_frame[c, :3] - model.contact_radius[c] - model.contact_height[c]))
    return out
