"""Cheapest paths where faces and slopes cost, and the fields of their costs."""
