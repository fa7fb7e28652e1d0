"""The picture of a map, as far as arithmetic can judge it."""

import cv2
import numpy as np

import qualrl
from qualrl.report.overlay import draw_overlay
from tests.worlds import TWO_ROOMS, grid_of


def test_names_leave_the_marks_of_start_and_goal_free(tmp_path):
    """With marks at the centres of both rooms, each mark's middle shows: white for the start, blue for the goal."""
    regions = qualrl.segment(grid_of(TWO_ROOMS))
    plan = qualrl.plan(qualrl.build(regions, "room B", start="room A"), exact=True)
    draw_overlay(regions, tmp_path / "marked.png", path=plan.path)
    marked = cv2.imread(str(tmp_path / "marked.png"))
    rows, columns = regions.label.shape
    scale, band = marked.shape[1] / columns, (marked.shape[0] - rows * marked.shape[1] / columns) / 2
    for region, colour in zip(regions.regions, ((255, 255, 255), (0x6B, 0x30, 0x08)), strict=True):
        row, column = (int((at + 0.5) * scale) for at in region.centre)
        middle = marked[int(row + band) - 2 : int(row + band) + 3, column - 2 : column + 3].reshape(-1, 3)
        assert np.median(middle, axis=0).tolist() == list(colour)
