"""The radio beside the antenna: its frequencies, its key, and whether it may send."""
