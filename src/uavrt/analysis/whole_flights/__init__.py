"""Search whole flights in their recorded samples, and put the results in words."""
