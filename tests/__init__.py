"""Tests, in folders that mirror the packages, and in three tiers.

``core``     the library; ``properties`` on random meshes, ``golden`` and ``paper`` against data
``app``      the service's parts, in this process
``cli``      the command line, in this process
``service``  what needs worker processes; has the marker of that name
``page``     the page in a browser; likewise
``support``  what they share: meshes, oracles, checks, and how a service is started

``scripts/test --quick`` leaves out ``service``, ``page`` and what is marked ``slow``;
``scripts/test``, like plain ``pytest``, runs everything, of tests marked ``slice(count)`` a seeded
sample of that many cases, of files marked ``file_slice(count)`` one of that many tests, unless they
are named; ``scripts/test --full`` runs these whole, and what is marked ``full`` or ``plain``.
What is marked ``plain`` runs in ``scripts/coverage`` as well, and what is marked ``jit`` does not.
"""
