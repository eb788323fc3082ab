"""The HTTP service over ``geodesic_core``."""

__version__ = "0.3.0"
