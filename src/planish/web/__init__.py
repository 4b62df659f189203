"""A service: scans are dropped on a page in the browser, or sent to an HTTP API, and pages come back."""
