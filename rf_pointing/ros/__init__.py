"""What all nodes and clients share: parameters, topics, lifecycle, messages, launching."""
