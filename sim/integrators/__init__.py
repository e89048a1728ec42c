"""Motions: loops over time with and without gains and derivatives, and steps of order 4 to 8.

An engine in sim/simulator/engines links the step of an order, such as high_order_engine.py.
"""
