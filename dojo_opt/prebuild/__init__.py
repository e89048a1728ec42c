"""Code compiled ahead of time: every public call on scenes with every feature, into files that ship with the package.

python -m dojo_opt.prebuild --out DIR    as the build of a wheel does (hatch_build.py)
"""
