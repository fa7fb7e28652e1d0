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


def found(argument: str, suffix: str) -> Path:
    """The file or folder an argument names; what is not there may be a bundled file, with or without its suffix."""
    path = Path(argument)
    if path.exists():
        return path
    name = argument.removeprefix("maps/")
    if "/" not in name and "\\" not in name:
        for candidate in (name, name + suffix):
            if candidate and (bundled_folder() / candidate).is_file():
                return bundled_folder() / candidate
    return path
