"""Search whole flights' recorded samples for tags, and describe the results."""
