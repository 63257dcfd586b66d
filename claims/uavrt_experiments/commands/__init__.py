"""``uavrt experiment NAME``: one module for each, imported when it is called."""
