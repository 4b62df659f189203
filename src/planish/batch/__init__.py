"""Batch processing: restore many scans, each into its own folder; interrupted runs can be resumed."""

from planish.batch.items import Item, ScanList, find_items
from planish.batch.list_file import read_list
from planish.batch.options import BatchOptions
from planish.batch.pools import DaskPool, LocalPool, Pool
from planish.batch.row import Row
from planish.batch.run import Counts, batch

__all__ = [
    "BatchOptions",
    "Counts",
    "DaskPool",
    "Item",
    "LocalPool",
    "Pool",
    "Row",
    "ScanList",
    "batch",
    "find_items",
    "read_list",
]
