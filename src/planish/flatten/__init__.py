"""From a bent sheet to the plane: one file per method behind one function."""

from planish.flatten.verlet import settle

__all__ = ["settle"]
