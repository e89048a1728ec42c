"""Identification: the parameters of a simulator as one vector, for optimisers that fit them to data."""
