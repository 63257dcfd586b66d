"""The thesis's rotation test (§5.5) again: where its 50° came from."""
