"""Studies: each figure of the paper measured again, and what the paper says of it judged by the measurements.

One folder a figure holds ``settings.yaml``: what is run, and the paper's numbers and claims.
"""
