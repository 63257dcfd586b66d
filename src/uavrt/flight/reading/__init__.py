"""Read flights and pulse logs: complete, damaged or of another system."""
