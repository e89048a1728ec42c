"""Joints inside a step: springs, dampers, inputs, limits, and the kinds with kinematics of their own."""
