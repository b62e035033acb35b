"""How sure e_n and quality are: errors of the mesh and of inputs, as a band of every case.

What has a closed form is taken from it; the rest is found on a few candidates, the probes, which are solved again with
an input changed, and carried to the others.
"""
