"""The radio of the antenna: its frequencies, its key, and whether it may send."""
