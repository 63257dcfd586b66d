"""Areas, paths and missions of other programs, and plans for them."""
