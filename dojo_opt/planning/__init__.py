"""Planning: a problem as arrays, and iLQR, which solves it.

The costs and constraints that users write are in dojo_opt/cost.py and dojo_opt/constraint.py.
"""
