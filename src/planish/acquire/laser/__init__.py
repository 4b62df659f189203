"""Laser lines: a sweep over the sheet, or a few fixed ones across an open book."""
