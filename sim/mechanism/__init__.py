"""The parts of a mechanism: bodies, joints, contacts, shapes, terrain; and their packing into the arrays of a Model.

A new joint kind begins in joint.py (`KINDS`), a new shape in shapes.py; CONTRIBUTING.md has the further places.
"""
