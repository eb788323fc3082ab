"""Soak: mixed traffic on a service whose caches are small, with every answer checked.

`plan` says what is sent and what must come back, `reference` computes that with the library alone,
`traffic` sends it (a process of its own), `memory` watches the service meanwhile, `trial` puts the
three together, and `report` writes what was seen.
"""
