"""What can be said of a triangle mesh before anything is flattened."""

from planish.mesh.topology import Topology, topology

__all__ = ["Topology", "topology"]
