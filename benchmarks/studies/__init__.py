"""The studies of `python -m benchmarks.report`: reference scenes, and other engines on the same scenes."""
