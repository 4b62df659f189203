"""What can be said and done with a triangle mesh before anything is flattened."""

from planish.mesh.raster import rasterise
from planish.mesh.topology import Topology, topology

__all__ = ["Topology", "rasterise", "topology"]
