"""The same examples on every run, so that a red run can be repeated; no deadline, as kernels compile on first use."""

from hypothesis import settings

settings.register_profile("planish", derandomize=True, deadline=None)
settings.load_profile("planish")
