"""``qualrl schema``: the JSON Schema of scenario files."""

import json

from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, Quiet


@guarded
def schema(as_json: AsJson = False, quiet: Quiet = False, debug: Debug = False) -> None:
    """Print the JSON Schema of scenario files, for editors."""
    from qualrl.io.scenario import scenario_schema

    document = scenario_schema()
    Console(as_json, quiet).result(document, lambda: print(json.dumps(document, indent=2)))
