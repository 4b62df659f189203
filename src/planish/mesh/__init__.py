"""What can be said and done with a triangle mesh before anything is flattened."""

from planish.mesh.adjacency import neighbours
from planish.mesh.decimation import Coarse, subsample
from planish.mesh.file_order import faces_to_file_order, from_file_order, to_file_order
from planish.mesh.grid_faces import grid_faces, without_small_components
from planish.mesh.measures import (
    LEAST_HEIGHT,
    angle_sums,
    area_vectors,
    border_loops,
    bounds,
    edges_with_area,
    point_normals,
    relative_heights,
)
from planish.mesh.memory_order import local_order, renumbered, renumbered_faces
from planish.mesh.prolongation import prolongate
from planish.mesh.raster import rasterize
from planish.mesh.repair import repair
from planish.mesh.support_plane import onto_support_plane
from planish.mesh.topology import topology
from planish.types import Topology

__all__ = [
    "LEAST_HEIGHT",
    "Coarse",
    "Topology",
    "angle_sums",
    "area_vectors",
    "border_loops",
    "bounds",
    "edges_with_area",
    "faces_to_file_order",
    "from_file_order",
    "grid_faces",
    "local_order",
    "neighbours",
    "onto_support_plane",
    "point_normals",
    "prolongate",
    "rasterize",
    "relative_heights",
    "renumbered",
    "renumbered_faces",
    "repair",
    "subsample",
    "to_file_order",
    "topology",
    "without_small_components",
]
