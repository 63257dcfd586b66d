"""Channels as UDP datagrams, in the format of the original channelizer."""
