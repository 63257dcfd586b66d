"""Routes of the web server."""
