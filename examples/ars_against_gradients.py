"""Random search against gradients through contact: a half-cheetah and an ant learn to run, with a linear policy.

python examples/ars_against_gradients.py        prints returns, writes ars_against_gradients.png

The numbers of steps and the settings of random search are those of Dojo's publication (arXiv 2203.00806, Table VI):
there, half-cheetahs earn 46 +- 24 by random search and 44 +- 24 by gradient search with a sixth of the steps. The
robots here are Gymnasium's, with its rewards: an ant earns 1 per step for not falling. SHAC has the steps of random
search, which are few for it.
"""

from dataclasses import replace

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo

SEEDS = range(1 if QUICK else 5)
TASKS = {  # task, steps of an episode, updates of random search and of gradient search
    "half-cheetah": (dojo.learn.half_cheetah, 80, 10 if QUICK else 30, 20 if QUICK else 60),
    "ant": (dojo.learn.ant, 150, 4 if QUICK else 60, 8 if QUICK else 60),
}
figure = Figure(figsize=(8.0, 4.0), layout="constrained")
for axes, (name, (make, steps, updates, ascents)) in zip(figure.subplots(1, 2), TASKS.items(), strict=True):
    task = replace(make(), steps=steps)
    batches = updates * 12 * steps // (64 * 16)  # of SHAC
    common = {"evaluations": 5, "episodes": 4}
    runs = {
        "random search": dojo.learn.seeds(
            dojo.learn.ars, task, SEEDS, epochs=updates, directions=6, best=6, rate=0.02, noise=0.03, **common
        ),
        "gradient search": dojo.learn.seeds(
            dojo.learn.gradient_search, task, SEEDS, epochs=ascents, environments=1, rate=0.05, **common
        ),
        "SHAC": dojo.learn.seeds(
            dojo.learn.shac, task, SEEDS, epochs=4 * batches, environments=16, hidden=(32,), **common
        ),
    }
    for k, (algorithm, found) in enumerate(runs.items()):
        returns = np.array([run.best for run in found])
        seconds, done = np.mean([run.seconds for run in found]), np.mean([run.steps for run in found])
        print(
            f"{name}, {algorithm}: {returns.mean():.1f} +- {returns.std():.1f} ({returns.min():.1f} to "
            f"{returns.max():.1f}) after {done:.0f} steps, {seconds:.1f} s"
        )
        axes.plot(np.full(len(returns), k), returns, "o", alpha=0.6)
        axes.plot([k - 0.2, k + 0.2], [returns.mean()] * 2, color="black")
        assert all(run.unsolved == run.infinite == 0 for run in found), algorithm
    still = np.mean([np.mean(run.history[0]["return"] or 0.0) for run in runs["random search"]])
    assert max(run.best for run in runs["random search"]) > still, still
    axes.set(xticks=range(3), xticklabels=runs, title=f"{name}, {steps} steps", ylabel="return without noise")
finish(figure, __file__)
