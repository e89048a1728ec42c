"""What a user puts together: bodies, joints, contacts, shapes, terrain; and its packing into the arrays of a Model."""
