"""The public names of dojo_opt and where they live: read by type checkers and editors, and by `__init__.py`."""

from dojo_opt import (
    bridges as bridges,
    constraint as constraint,
    cost as cost,
    gaits as gaits,
    learn as learn,
    models as models,
    plots as plots,
    problems as problems,
    report as report,
    tasks as tasks,
    viewer as viewer,
)
from dojo_opt.gaits.equilibrium import equilibrium as equilibrium
from dojo_opt.identification.identify import (
    Identified as Identified,
    IdentifyOptions as IdentifyOptions,
    identify as identify,
)
from dojo_opt.identification.parameter_space import ParameterSpace as ParameterSpace
from dojo_opt.learn.environment import Environment as Environment
from dojo_opt.mpc.adaptation import Adaptation as Adaptation
from dojo_opt.mpc.controller import MPC as MPC
from dojo_opt.mpc.moving_reference import (
    AnchoredReference as AnchoredReference,
    SampledReference as SampledReference,
)
from dojo_opt.mpc.rescue import Rescue as Rescue
from dojo_opt.mpc.settings import MPCSettings as MPCSettings
from dojo_opt.planning.ilqr import ilqr as ilqr
from dojo_opt.planning.options import Options as Options, Stage as Stage
from dojo_opt.planning.plan import Plan as Plan
from dojo_opt.planning.plan_library import plan_library as plan_library
from dojo_opt.planning.problem import Problem as Problem
from dojo_opt.planning.residual import jit as jit
from dojo_opt.planning.tracking import tracking_gains as tracking_gains
from dojo_opt.plant.disturbances import Disturbances as Disturbances
from dojo_opt.plant.closed_loop import ClosedLoop as ClosedLoop, closed_loop as closed_loop
from dojo_opt.report.identification import identification_report as identification_report
from dojo_opt.plant.perturbation import Perturbation as Perturbation, Push as Push
from dojo_opt.plant.plant import Plant as Plant
from dojo_opt.plant.monte_carlo import monte_carlo as monte_carlo
from sim.mechanism.collision import Collision as Collision
from sim.mechanism.gear import Gear as Gear
from sim.mechanism.mechanism import Mechanism as Mechanism
from sim.io.mjcf import MjcfMechanism as MjcfMechanism, MjcfWarning as MjcfWarning, load_mjcf as load_mjcf
from sim.derivatives.parameters.parameters import Parameters as Parameters
from sim.mechanism.body import Body as Body
from sim.mechanism.contact import Contact as Contact
from sim.mechanism.input import Input as Input
from sim.mechanism.joint import Joint as Joint
from sim.mechanism.polytope import Polytope as Polytope
from sim.simulator.reactions import Reactions as Reactions
from sim.simulator.derivative_results import (
    Gradient as Gradient,
    Jacobian as Jacobian,
    Linearization as Linearization,
)
from sim.simulator.results import (
    Contacts as Contacts,
    FeedbackRollout as FeedbackRollout,
    Interrupted as Interrupted,
    RolloutBatch as RolloutBatch,
    SimulationError as SimulationError,
    StepResult as StepResult,
    Trajectory as Trajectory,
)
from sim.simulator.step_batch import StepBatch as StepBatch
from sim.mechanism.shapes import (
    Box as Box,
    Capsule as Capsule,
    Cylinder as Cylinder,
    Ellipsoid as Ellipsoid,
    HalfSpace as HalfSpace,
    Sphere as Sphere,
    String as String,
)
from sim.mechanism.signed_distance import SignedDistance as SignedDistance
from sim.simulator.simulator import Simulator as Simulator
from sim.simulator.inverse_kinematics import IkResult as IkResult, ik as ik
from sim.simulator.kinematics import Kinematics as Kinematics
from sim.mechanism.terrain import Terrain as Terrain
from sim.mechanism.visual import Visual as Visual
from sim.io.urdf.load import load_urdf as load_urdf
from sim.io.urdf.report import UrdfMechanism as UrdfMechanism, UrdfWarning as UrdfWarning
from sim.io.urdf.xml import UrdfError as UrdfError
from solvers.status import Status as Status

__all__: list[str]
__version__: str
