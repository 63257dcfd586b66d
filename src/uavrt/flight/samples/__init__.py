"""Record samples: the whole band, and the channels of the tags."""
