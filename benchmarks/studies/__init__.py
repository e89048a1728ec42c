"""The studies of `python benchmarks/compare.py`: reference scenes, and other engines on the same scenes."""
