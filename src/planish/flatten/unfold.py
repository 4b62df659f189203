"""A flat layout from nothing but the lengths of a mesh's edges: clusters unfolded one by one, then joined."""

from __future__ import annotations

from planish.flatten.clusters import lay_out_clusters
from planish.flatten.crew import Crew
from planish.flatten.joints import gather, join
from planish.mesh import Topology
from planish.types import Floats, Ints


def lay_out(faces: Ints, topology: Topology, edge_rest: Floats, point_count: int, run: Crew) -> tuple[Floats, Ints]:
    """TODO"""
    clusters = lay_out_clusters(faces, topology, edge_rest, point_count, run)
    rho, tau, piece = join(clusters)
    return gather(clusters, rho, tau), piece[clusters.cluster[clusters.start[:-1]]]
