"""The parts of a mechanism: bodies, joints, contacts, shapes, terrain; and their packing into the arrays of a Model."""
