"""Contacts: the contact laws, contact with the ground, restitution, and the set of active contacts."""
