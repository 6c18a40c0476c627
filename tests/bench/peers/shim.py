"""Module names that stlpy 0.3.0 imports and newer Drake has moved; import this before stlpy."""

import sys

import pydrake.solvers

for name in ("branch_and_bound", "all"):
    sys.modules.setdefault(f"pydrake.solvers.{name}", pydrake.solvers)
