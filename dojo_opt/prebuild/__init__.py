"""Ahead-of-time compilation: every public call, on scenes with every feature, into files that ship with the package.

python -m dojo_opt.prebuild --out DIR    as the build hook of a wheel does
"""
