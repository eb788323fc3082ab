"""Memory that a worker shares with the service."""

from ctypes import Structure, c_double, c_longlong


class Signals(Structure):
    """Memory that a worker shares with the service."""

    _fields_ = (
        ("stop_number", c_longlong),  # of the work to stop; earlier work has ended
        ("begun_number", c_longlong),  # of the work that was begun last
        ("progress", c_double),  # share of that work that is done
        # Totals of this worker and those before it in its slot:
        ("mesh_evictions", c_longlong),  # open meshes closed to make room
        ("field_evictions", c_longlong),  # cached fields dropped to make room
        ("stored_field_evictions", c_longlong),  # fields removed from the store to make room
    )
