"""Every number that an answer says stands in its JSON twin, or is the difference, sum or share of numbers there."""

import itertools
import json
import math
import re
from fractions import Fraction

import pytest

import qualrl
from qualrl.answers.answer import SELDOM
from qualrl.answers.sureness import ORDERS
from qualrl.qualitative.from_counts import Counts, Samples
from tests.test_planning import LOOP
from tests.worlds import grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
PLAIN = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.95)
SLIPPERY = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.95, slip=0.2)
DIAGONAL = qualrl.build(REGIONS, [2, 24], start=[2, 2], gamma=0.95, directions=8)
DOORS = [door.name for door in REGIONS.doorways]
CUT = PLAIN.with_closed(DOORS[:4])
ASK = qualrl.questions
FIRST = qualrl.plan(PLAIN).steps[0].action.split(" to ")[0].removeprefix("go through ")
ASIDE = next(name for name in REGIONS.region_names if name not in qualrl.plan(PLAIN).places)


def trained(learner, **settings):
    return qualrl.train(PLAIN, learner, episodes=40, seed=3, **settings)


QUESTIONS = {
    "why": lambda: ASK.why(PLAIN),
    "why, slips": lambda: ASK.why(SLIPPERY),
    "why, diagonals": lambda: ASK.why(DIAGONAL),
    "why, slips, gammas": lambda: ASK.why(SLIPPERY, gammas=(0.5, 0.99)),
    "why not": lambda: ASK.why_not(PLAIN, ASIDE),
    "why not, slips": lambda: ASK.why_not(SLIPPERY, ASIDE),
    "why not, slips, gammas": lambda: ASK.why_not(SLIPPERY, ASIDE, gammas=(0.5, 0.99)),
    "what if closed": lambda: ASK.what_if(PLAIN, close=FIRST, chance=0.6),
    "what if slip": lambda: ASK.what_if(PLAIN, slip=0.3),
    "what if gamma": lambda: ASK.what_if(PLAIN, gamma=0.5),
    "what if opened": lambda: ASK.what_if(PLAIN, open=(REGIONS.region_names[0], REGIONS.region_names[2])),
    "which matters": lambda: ASK.which_matters(PLAIN),
    "which matters, slips": lambda: ASK.which_matters(SLIPPERY),
    "why unreachable": lambda: ASK.why_unreachable(CUT),
    "reconcile": lambda: ASK.reconcile(PLAIN, [qualrl.plan(PLAIN).places[0], ASIDE, qualrl.plan(PLAIN).places[-1]]),
    "reconcile, slips": lambda: ASK.reconcile(
        SLIPPERY, [qualrl.plan(SLIPPERY).places[0], ASIDE, qualrl.plan(SLIPPERY).places[-1]]
    ),
    "signs": lambda: ASK.signs(PLAIN),
    "envision": lambda: ASK.envision(PLAIN),
    "envision, slips": lambda: ASK.envision(SLIPPERY),
    "summary": lambda: ASK.summary(PLAIN),
    "summary, slips": lambda: ASK.summary(SLIPPERY),
    "how sure": lambda: trained("hql").how_sure(count=True),
    "how sure, uncounted": lambda: trained("sarsa").how_sure(),
    "how sure, seeds": lambda: trained("hql").how_sure(seeds=5),
    "robust": lambda: ASK.robust(PLAIN, doors={FIRST: (0.2, 0.9)}, times={"*": (1.0, 1.25)}),
    "robust, counted": lambda: ASK.robust(PLAIN, doors={FIRST: Counts(6, 9)}, times={"*": Samples((1.0, 1.25, 2.5))}),
    "robust, slips": lambda: ASK.robust(PLAIN, slip=(0.05, 0.4)),
    "robust, counted slips": lambda: ASK.robust(PLAIN, slip=Counts(3, 40)),
}
NUMBER = re.compile(r"(?<![\w.])-?(?:\d{1,3}(?:,\d{3})+|\d+)(?:\.\d+)?(?:e[+-]?\d+)?(?!\w)")
KNOWN = {"0", "1", f"{SELDOM:g}"}
"""The ends of (0, 1), and what is too seldom to be named."""


def leaves(document):
    """All numbers and texts of a document, lengths of its lists among them; lists of cells by their length alone."""
    if isinstance(document, dict):
        for key, value in document.items():
            yield key
            yield from leaves(value)
    elif isinstance(document, list):
        yield len(document)
        if len(document) < 60:
            for value in document:
                yield from leaves(value)
    elif isinstance(document, str) and re.fullmatch(r"-?\d+/\d+", document):
        yield float(Fraction(document))
    elif document is not None and not isinstance(document, bool):
        yield document


def told(value):
    """A number as sentences may write it."""
    texts = {f"{value:.{digits}g}" for digits in (2, 3, 4, 6)} | {f"{value:.2f}", f"{value:.1f}"}
    if value == int(value):
        texts |= {f"{int(value)}", f"{int(value):,}"}
    return texts | {text.removeprefix("-") for text in texts}


def shares(a, b):
    """The lesser of two numbers in hundredths of the greater."""
    return {f"{100 * a / b:.0f}"} if 0 < a <= b else set()


def as_good_as(document):
    """How many steps the waits that were measured are worth, at the points where one way is better than another."""
    if not document.get("measured"):
        return set()
    points = [order[kind] or {} for order in document["orders"] for kind in ("better_at", "worse_at", "equal_at")]
    points += [dict([order["change"]]) for order in document["orders"] if order["change"]]
    waits = {
        steps + math.log(point[key]) / math.log(document["gamma"])
        for key, steps in document["measured"].items()
        for point in points
        if key in point
    }
    return set().union(*map(told, waits))


@pytest.mark.parametrize("question", QUESTIONS)
def test_the_numbers_of_a_sentence_are_those_of_the_twin(question):
    answer = QUESTIONS[question]()
    document = json.loads(json.dumps(answer.to_dict(), allow_nan=False))
    sentences = document.pop("sentences")
    assert sentences == answer.explain().splitlines()
    found = list(leaves(document))
    names = sorted({text for text in found if isinstance(text, str)} | set(ORDERS), key=len, reverse=True)
    numbers = sorted({float(number) for number in found if not isinstance(number, str)})
    single = set().union(*(told(number) for number in numbers))
    pairs = list(itertools.combinations(numbers[:120], 2))
    double = set().union(*(told(a - b) | told(a + b) | shares(a, b) for a, b in pairs))
    double |= as_good_as(document)
    for line in sentences:
        plain = line
        for name in names:
            plain = plain.replace(name, "NAME")
        for text in NUMBER.findall(re.sub(r"^(Way )?\d+[.:]", "", plain)):
            assert text in single | double | KNOWN, f"{text!r} of {line!r} is nowhere in the twin"
