"""Error against run time: every method on every scene, held against truths, beside the tools people use today.

Part of the package, so that an installed wheel has `glcaustics bench`; what it needs beyond the core packages is the
extra `bench`. Nothing else imports it, but the command line.
"""
