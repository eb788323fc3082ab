"""The front that all sweeps share: windows, vertices, sites, segments, queues and bounds."""
