"""What all sweeps share: windows and their pool, vertices, sites, segments, queues and bounds."""
