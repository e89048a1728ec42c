"""Narrow phase: distance, normal and point of two shapes, with derivatives; knows no mechanism and no step.

The shapes that users write are in sim/mechanism/shapes.py.
"""
