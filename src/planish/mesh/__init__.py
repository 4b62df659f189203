"""What can be said and done with a triangle mesh before anything is flattened."""

from planish.mesh.adjacency import neighbours
from planish.mesh.decimation import Coarse, subsample
from planish.mesh.file_order import from_file_order, to_file_order
from planish.mesh.grid_faces import lattice_faces, without_crumbs
from planish.mesh.measures import angle_sums, area_vectors, border_loops, bounds, point_normals
from planish.mesh.memory_order import local_order, renumbered
from planish.mesh.prolongation import carry
from planish.mesh.raster import rasterise
from planish.mesh.repair import Cleaned, clean
from planish.mesh.support_plane import stand_on_table
from planish.mesh.topology import Topology, topology

__all__ = [
    "Cleaned",
    "Coarse",
    "Topology",
    "angle_sums",
    "area_vectors",
    "border_loops",
    "bounds",
    "carry",
    "clean",
    "from_file_order",
    "lattice_faces",
    "local_order",
    "neighbours",
    "point_normals",
    "rasterise",
    "renumbered",
    "stand_on_table",
    "subsample",
    "to_file_order",
    "topology",
    "without_crumbs",
]
