"""The compiled core: plain functions over arrays, as the paper describes them.

Kernels return status codes and raise nothing; `geodesic_core.solvers` turns codes into exceptions.
"""
