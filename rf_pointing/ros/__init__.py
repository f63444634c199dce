"""Common part of all nodes and clients: parameters, topics, lifecycle, messages, launching."""
