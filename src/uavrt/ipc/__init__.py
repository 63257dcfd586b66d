"""How the processes talk: records as JSON lines, samples as datagrams."""
