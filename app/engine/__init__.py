"""Execution of queries in worker processes that can be stopped, killed and replaced."""
