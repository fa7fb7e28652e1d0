"""Training of what the segmentation has learned: needs the extra ``train`` (scikit-learn)."""
