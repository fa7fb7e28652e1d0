"""Where the bundled maps lie."""

from pathlib import Path

SCENARIO_SUFFIX = ".scenario.yaml"


def bundled_folder() -> Path:
    """Inside the package, or beside it in a checkout."""
    inside = Path(__file__).parent.parent / "maps"
    return inside if inside.is_dir() else inside.parent.parent / "maps"


def bundled_names() -> list[str]:
    """The names of the bundled scenarios."""
    return sorted(path.name.removesuffix(SCENARIO_SUFFIX) for path in bundled_folder().glob(f"*{SCENARIO_SUFFIX}"))
