"""Engines: one class for each way in which steps are made; engine_choice.py lists them."""
