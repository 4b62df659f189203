"""Web service: a browser page and an HTTP API that take scans and return restored pages."""
