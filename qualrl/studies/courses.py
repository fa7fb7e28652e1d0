"""From a study's settings to the world that its learners are put in."""

from qualrl.studies.budget import Course
from qualrl.studies.fig13.score import Navigation
from qualrl.studies.settings import Budget
from qualrl.studies.taxi.score import TaxiCourse


def course_of(budget: Budget) -> Course:
    """The course.  Raises SettingError when the taxi's extra is not installed, ScenarioError for a wrong map."""
    return Navigation(budget) if budget.world == "map" else TaxiCourse(budget)
