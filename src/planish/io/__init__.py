"""Files to and from the types: scans, photos, cameras, pages, flat meshes, reports."""

from planish.io.cameras import read_camera, scaled_camera
from planish.io.captures import image_files, read_captures
from planish.io.clouds import read_cloud
from planish.io.depths import read_depths
from planish.io.distortion_files import distortion_files, write_distortion
from planish.io.exif import focal_length_px
from planish.io.files import all_or_nothing, check_writable, make_folder, write_bytes, write_json
from planish.io.flats import check_flat_name, uv_unit_mm, write_flat
from planish.io.images import Photo, read_photo
from planish.io.metadata import Origin, fingerprints, origin_of
from planish.io.ocr import check_ocr, text_layer, way_up
from planish.io.pages import check_page_name, page_names, write_page, write_pages
from planish.io.scan_write import write_scan
from planish.io.scans import ReadScan, read_scan
from planish.io.units import scale_bar
from planish.io.unscaled import write_unscaled_page

__all__ = [
    "Origin",
    "Photo",
    "ReadScan",
    "all_or_nothing",
    "check_flat_name",
    "check_ocr",
    "check_page_name",
    "check_writable",
    "distortion_files",
    "fingerprints",
    "focal_length_px",
    "image_files",
    "make_folder",
    "origin_of",
    "page_names",
    "read_camera",
    "read_captures",
    "read_cloud",
    "read_depths",
    "read_photo",
    "read_scan",
    "scale_bar",
    "scaled_camera",
    "text_layer",
    "uv_unit_mm",
    "way_up",
    "write_bytes",
    "write_distortion",
    "write_flat",
    "write_json",
    "write_page",
    "write_pages",
    "write_scan",
    "write_unscaled_page",
]
