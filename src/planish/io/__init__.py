"""Files to and from the types: scans, photos, cameras, pages, flat meshes, reports."""

from planish.io.cameras import read_camera
from planish.io.files import check_writable, make_folder, write_json
from planish.io.flats import check_flat_name, write_flat
from planish.io.images import Photo, read_photo
from planish.io.pages import check_page_name, write_page, write_pages
from planish.io.scan_write import write_scan
from planish.io.scans import ReadScan, read_scan

__all__ = [
    "Photo",
    "ReadScan",
    "check_flat_name",
    "check_page_name",
    "check_writable",
    "make_folder",
    "read_camera",
    "read_photo",
    "read_scan",
    "write_flat",
    "write_json",
    "write_page",
    "write_pages",
    "write_scan",
]
