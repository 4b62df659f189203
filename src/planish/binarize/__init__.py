"""Binarization: which pixels are ink."""

from planish.binarize.threshold import binarize

__all__ = ["binarize"]
