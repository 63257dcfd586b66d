"""From recordings and flights to results."""
