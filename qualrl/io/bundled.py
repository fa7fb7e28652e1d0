"""Where the bundled maps lie."""

from pathlib import Path


def bundled_folder() -> Path:
    """Inside the package, or beside it in a checkout."""
    inside = Path(__file__).parent.parent / "maps"
    return inside if inside.is_dir() else inside.parent.parent / "maps"
