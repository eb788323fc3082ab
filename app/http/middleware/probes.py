"""Probes: paths by which orchestrators and load balancers ask whether the service is well."""

PROBES = frozenset({"/livez", "/readyz"})
