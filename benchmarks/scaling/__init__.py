"""Scaling: a queueing model of the service, held against what runs here, then made larger.

`model` says how questions pass replicas and hosts. `nodes` runs the real service under a known
load, and `validation` has the model predict the same. `figures` measures what a question, a mesh
and a replica take here; `traffic` draws questions as many users ask them; `growth` goes from one
machine to a billion meshes and a million questions a second; `report` writes it all down.
"""
