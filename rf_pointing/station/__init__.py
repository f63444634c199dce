"""The parts of a station, assembled from the folders below and stepped by time: what each node
wraps.
"""
