"""Joints inside a step: springs, dampers, inputs, limits, and the kinds with kinematics of their own.

The list of joint kinds is `KINDS` in sim/mechanism/joint.py.
"""
