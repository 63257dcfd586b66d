"""Read flights and pulse logs: complete, damaged, or written by other systems."""
