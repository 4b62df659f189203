"""Pipeline: from a scan to a flat page and a quality report."""

from planish.pipeline.flatten import flatten
from planish.pipeline.orient import OrientationReader
from planish.pipeline.prepare import prepare
from planish.pipeline.restore import restore
from planish.pipeline.stages import Progress

__all__ = ["OrientationReader", "Progress", "flatten", "prepare", "restore"]
