"""Send and receive channels as UDP datagrams, in the format of the original channelizer."""
