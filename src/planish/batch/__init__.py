"""Shelves of scans: every one restored into its own folder, however often the run is stopped and started again."""

from planish.batch.items import Found, Item, find_items
from planish.batch.listing import read_list
from planish.batch.order import Order
from planish.batch.pools import Cluster, Local, Pool
from planish.batch.row import Row
from planish.batch.run import Counts, batch

__all__ = [
    "Cluster",
    "Counts",
    "Found",
    "Item",
    "Local",
    "Order",
    "Pool",
    "Row",
    "batch",
    "find_items",
    "read_list",
]
