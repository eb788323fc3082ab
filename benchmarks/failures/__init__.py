"""Failures: what clients see while a part of a deployment fails, and how soon all is as before.

`failures` says what can fail and which refusals are documented for it, `traffic` is the load (a
process of its own, with the requests and right answers of the soak), `trial` lets one failure
happen under load and looks at everything, and `report` writes what was seen.
"""
