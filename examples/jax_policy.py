"""Train a small network to land a hopper: gradient descent in JAX, through the contacts of the simulator.

python examples/jax_policy.py        needs pip install "dojo-opt[jax]"; writes jax_policy.png
"""

import jax
import jax.numpy as jnp
import numpy as np
from _common import QUICK, finish
from jax.example_libraries.optimizers import adam, clip_grads
from matplotlib.figure import Figure

import dojo_opt as dojo

jax.config.update("jax_enable_x64", True)
STEPS, ROUNDS, UNSEEN = 40, 60 if QUICK else 100, 32
sim = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.02, kappa=1e-4)
hard = sim.replace(time_step=0.005, kappa=1e-8)
step, _ = dojo.bridges.to_jax(sim, kappa=1e-3)  # derivatives that feel the ground before the foot is there
stand, weight = sim.neutral(), 9.81 * sum(body.mass for body in sim.mechanism.bodies)
# tossed from .05 to .3 m above standing, tilted by up to .3 rad about x and y, turning at up to .6 rad/s
widest, rng = np.array([0, 0, 0.125, 0.3, 0.3, 0, 0, 0.3, 0.3, 0, 0.6, 0.6, 0, 0]), np.random.default_rng(0)
tosses = widest * rng.uniform(-1.0, 1.0, (16 + UNSEEN, sim.ndx)) + 0.175 * np.eye(sim.ndx)[2]
seen, unseen = np.split(sim.integrate(stand, tosses), [16])


@jax.jit
def policy(net: list, x: jax.Array) -> jax.Array:
    """Torques [N m] and leg force [N] from height, attitude, leg length and velocities, by two layers."""
    (W, b), (V, c) = net
    sensed = jnp.concatenate([x[2:3] - stand[2], x[4:7], x[7:8] - stand[7], 0.2 * x[8:]])
    return jnp.array([0.0, 0.0, weight]) + jnp.array([30.0, 30.0, 100.0]) * jnp.tanh(V @ jnp.tanh(W @ sensed + b) + c)


def loss(net: list, x0s: jax.Array) -> jax.Array:
    """Mean squares of height, attitude, leg and velocities away from standing still, more and more over the time."""
    scan = jax.vmap(lambda x0: jax.lax.scan(lambda x, _: (step(x, policy(net, x)),) * 2, x0, None, STEPS)[1])
    off = (scan(x0s) - stand)[..., 2:] * jnp.sqrt(jnp.array([1.0, 0.0] + [8.0] * 3 + [1.0] + [0.02] * 7))
    return jnp.mean(jnp.linspace(0.0, 2.0, STEPS) * jnp.sum(off**2, axis=-1))


untrained = [(0.3 * rng.normal(size=(16, 12)), np.zeros(16)), (0.1 * rng.normal(size=(3, 16)), np.zeros(3))]
(begin, update, net_of), losses = adam(0.05), []
state, slope = begin(untrained), jax.jit(jax.value_and_grad(loss))
for k in range(ROUNDS):
    value, gradient = slope(net_of(state), seen)
    state = update(k, clip_grads(gradient, 1.0), state)
    losses.append(float(value))
axes, stands = (figure := Figure(figsize=(9.0, 3.2), layout="constrained")).subplots(1, 3), []
axes[0].semilogy(losses)
axes[0].set(xlabel="round", ylabel="loss, 16 tosses")
for ax, net, name in zip(axes[1:], (untrained, net_of(state)), ("untrained", "trained"), strict=True):
    runs = [hard.rollout(x0, lambda _, x, net=net: policy(net, x), steps=200).x for x0 in unseen]
    tilt = [np.degrees(2.0 * np.arcsin(np.hypot(x[:, 4], x[:, 5]))) for x in runs]
    ax.plot(hard.time_step * np.arange(201), np.transpose(tilt), lw=0.7)
    ax.set(title=f"{name}, {UNSEEN} other tosses", xlabel="time [s]", ylabel="tilt [deg]")
    stands.append(sum(degrees[-1] < 5.0 for degrees in tilt))
print(f"loss {losses[0]:.2f} -> {losses[-1]:.4f}; upright after 1 s: {stands[0]}, {stands[1]} of {UNSEEN} other tosses")
assert losses[-1] < 0.1 * losses[0] and stands[1] > 0.9 * UNSEEN > 5 * stands[0], stands
finish(figure, __file__)
