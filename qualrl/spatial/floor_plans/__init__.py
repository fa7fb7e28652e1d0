"""Random floor plans whose rooms are known: drawn, furnished, or as a robot's scanner would see them."""

from qualrl.spatial.floor_plans.plan import STYLES, FloorPlan, random_floor_plan

__all__ = ["STYLES", "FloorPlan", "random_floor_plan"]
