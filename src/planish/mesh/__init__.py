"""What can be said and done with a triangle mesh before anything is flattened."""

from planish.mesh.adjacency import neighbours
from planish.mesh.carry import carry
from planish.mesh.clean import Cleaned, clean
from planish.mesh.lattice import lattice_faces, without_crumbs
from planish.mesh.locality import local_order, renumbered
from planish.mesh.measures import angle_sums, area_vectors, border_loops, bounds, point_normals
from planish.mesh.place import from_file_order, to_file_order
from planish.mesh.projection import depths, project
from planish.mesh.raster import rasterise
from planish.mesh.srgb import LUMINANCE, code_values, linear_light
from planish.mesh.subsample import Coarse, subsample
from planish.mesh.support import stand_on_table
from planish.mesh.topology import Topology, topology

__all__ = [
    "LUMINANCE",
    "Cleaned",
    "Coarse",
    "Topology",
    "angle_sums",
    "area_vectors",
    "border_loops",
    "bounds",
    "carry",
    "clean",
    "code_values",
    "depths",
    "from_file_order",
    "lattice_faces",
    "linear_light",
    "local_order",
    "neighbours",
    "point_normals",
    "project",
    "rasterise",
    "renumbered",
    "stand_on_table",
    "subsample",
    "to_file_order",
    "topology",
    "without_crumbs",
]
