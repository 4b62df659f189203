"""A restoration as one page to look at, in a browser, from a file: nothing else is asked for."""

from planish.view.document import view_page

__all__ = ["view_page"]
