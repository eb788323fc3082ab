"""Kernels of certificates: the function on the edges by which distances are proved."""
