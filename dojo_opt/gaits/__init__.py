"""Reference motions of legged robots: gaits, standing, turning, jumps; by inverse kinematics and inverse dynamics."""

from dojo_opt.gaits.biped import step
from dojo_opt.gaits.gait import Gait
from dojo_opt.gaits.references import bound, hop, jump, pace, stand, trot, turn, walk

__all__ = ["Gait", "bound", "hop", "jump", "pace", "stand", "step", "trot", "turn", "walk"]
