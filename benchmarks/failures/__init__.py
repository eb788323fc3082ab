"""Failures: what clients see while a part of a deployment fails, and how soon all is as before.

`failures` says what can fail and which refusals are documented for it, `plan` has questions with
their right answers, `traffic` asks them (a process of its own), `trial` lets one failure happen
under load and looks at everything, and `report` writes what was seen.
"""
