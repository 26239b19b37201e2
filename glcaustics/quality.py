"""The steps of the quality ladder; here because files, command line and methods name them and share nothing else."""

QUALITIES = ("draft", "low", "medium", "high", "reference")
DEFAULT_QUALITY = "medium"
