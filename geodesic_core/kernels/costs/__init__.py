"""Cheapest ways where faces and slopes cost: points on edges as a graph, and paths straightened."""
