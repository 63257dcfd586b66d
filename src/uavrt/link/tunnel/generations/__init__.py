"""Messages of the original system's protocol, one module for each protocol generation."""
