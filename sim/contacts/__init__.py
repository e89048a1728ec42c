"""Contacts of points and spheres with the ground: their laws, and which of them are near."""
