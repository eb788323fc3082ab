"""The compiled core: plain functions over arrays, as the paper describes them.

Kernels return status codes and raise nothing. Their callers in `geodesic_core.fields` and
`geodesic_core.mesh` turn codes into exceptions.
"""
