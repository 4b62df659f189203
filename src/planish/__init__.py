"""planish: a 3D scan of a warped document goes in; the page comes out flat, at its true size in millimetres."""

__version__ = "0.1.0"
