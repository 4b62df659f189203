"""Interactive HTML page of a restoration, in one self-contained file."""

from planish.view.html_document import view_page

__all__ = ["view_page"]
