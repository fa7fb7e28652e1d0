"""``qualrl learners``: the learners by name, and what each converges to."""

from qualrl.commands.console import Console, guarded
from qualrl.commands.options import AsJson, Debug, Quiet


@guarded
def learners(as_json: AsJson = False, quiet: Quiet = False, debug: Debug = False) -> None:
    """List the learners: what each is, where it comes from, and what its values converge to."""
    from qualrl.commands.tables import print_learners
    from qualrl.learning.rules import RULES

    rows = [{"name": r.name, "title": r.title, "source": r.source, "limit": r.limit} for r in RULES.values()]
    Console(as_json, quiet).result({"learners": rows}, lambda: print_learners(rows))
