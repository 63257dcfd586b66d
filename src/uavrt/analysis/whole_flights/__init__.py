"""Search whole flights' recorded samples for tags, and describe results in words."""
