"""Facts about flights and logs that estimates and reports start from."""
