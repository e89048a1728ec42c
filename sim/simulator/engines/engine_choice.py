"""The choice of an engine: each class makes steps in a way of its own.

    class             chosen for                   a step
    Engine            order 2, divide=False        one call of the kernel `step`
    DividingEngine    order 2                      as Engine; where that fails, 2, 4, ... parts, each by an Engine
    HighOrderEngine   order 4, 6, 8                one call of the kernel `step`, which is an explicit method
    PhasedEngine      these with contacts, limits  as HighOrderEngine; of order 2 near contacts, by a DividingEngine
    AdaptiveEngine    an accuracy                  sub-steps of order 8, or of 2 and 4 by an Engine

They inherit so:

    LinkedModel -> Engine -> DividingEngine
                          -> HighOrderEngine -> PythonLoopEngine -> PhasedEngine
                                                                 -> AdaptiveEngine

LinkedModel has the tables that kernels read. Engine has all calls. DividingEngine and HighOrderEngine change how a step
is made and keep its loops. A step of the last two is several calls, so PythonLoopEngine replaces the loops. An engine
that needs steps of another kind holds an engine that makes them.

`engine.states` says what the velocity of a state is: its mean over the time step (MeanStates), or over an interval of
its own (IntervalStates, of DividingEngine), or that of the node (NodeStates, of the three with an order above 2).
"""

from __future__ import annotations

from sim.mechanism.mechanism import Mechanism
from sim.model.model import Model
from sim.simulator.engines.dividing_engine import DividingEngine
from sim.simulator.engines.engine import Engine
from sim.simulator.settings import Settings


def engine_of(model: Model, mechanism: Mechanism, settings: Settings) -> Engine:
    """The engine of a packed mechanism; modules of orders above 2 are imported by simulators that need them."""
    if settings.accuracy > 0.0:
        from sim.simulator.engines.adaptive_engine import AdaptiveEngine, check_adaptive

        check_adaptive(mechanism, settings.accuracy)
        return AdaptiveEngine(model, settings)
    if settings.order == 2:
        return DividingEngine(model, settings) if settings.divide else Engine(model, settings)
    from sim.simulator.engines.high_order_engine import HighOrderEngine, check

    check(mechanism, settings)
    engine = HighOrderEngine(model, settings)
    stiff = engine.too_stiff(mechanism)
    if len(model.contact_body) + len(model.limit_dof) or stiff:
        from sim.simulator.engines.phased_engine import PhasedEngine

        engine = PhasedEngine(model, settings, stiff)
    return engine
