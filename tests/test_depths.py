"""Answers at three depths of words: what each leaves out, that none tells what another does not, and that signs are
those of the numbers.
"""

import json
import math
import re
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import qualrl
from qualrl.answers import reconcile
from qualrl.answers.depth import Depth
from qualrl.errors import NoPlanError, SettingError
from qualrl.qualitative.plan_value import Course, Stretch, contrast
from tests.command_here import qualrl as qualrl_command
from tests.test_commands import draw
from tests.test_planning import LOOP
from tests.test_reconcile import THREE_ROOMS
from tests.test_why_unreachable import MAPPED, asked, blocked_maps, written
from tests.worlds import free_masks, grid_of

REGIONS = qualrl.segment(grid_of(LOOP))
CELLS = [tuple(cell) for cell in np.argwhere(REGIONS.grid.free).tolist()]
DOORS = [door.name for door in REGIONS.doorways]
NAMES = [*REGIONS.region_names, *DOORS]
ENDS = st.tuples(st.sampled_from(CELLS), st.sampled_from(CELLS)).filter(lambda ends: ends[0] != ends[1])
MOTIONS = st.fixed_dictionaries(
    {
        "gamma": st.sampled_from([0.5, 0.95, 0.99]), "slip": st.sampled_from([0.0, 0.0, 0.2]),
        "directions": st.sampled_from([4, 8]),
    }
)  # fmt: skip
NUMBERED = re.compile(r"\b(way|passage) \d+", re.IGNORECASE)
COMPARING = re.compile(
    r"\b(more|less|fewer|fewest|longer|longest|shorter|shortest|better|worse|smaller|smallest|larger|largest|greater"
    r"|higher|lower|nearer|nearest|wider|likely|likelier|likeliest|least|most|worth|costs|lost|gained|exactly|above"
    r"|below|grows|falls|as (long|much|good)|(for|against) it)\b",
    re.IGNORECASE,
)
LONGER = {-1: "shorter", 0: "as long", 1: "longer"}


def model_of(ends, motion):
    return qualrl.build(REGIONS, list(ends[1]), start=list(ends[0]), **motion)


def words_of(line):
    return re.findall(r"[^\s,;:.()]+", line)


def is_within(words, others):
    """Whether some words stand in others in their order, others between them."""
    rest = iter(others)
    return all(word in rest for word in words)


def check_depths(answer, regions=REGIONS):
    """What holds of every answer."""
    names, signs, numbers = (answer.explain(depth) for depth in ("names", "signs", "numbers"))
    places = [*regions.region_names, *(mark.name for mark in regions.landmarks), *(of.name for of in regions.doorways)]
    for text in (names, signs):
        for name in sorted(places, key=len, reverse=True):
            text = text.replace(name, "NAME")
        assert not re.search(r"\d", NUMBERED.sub("", text)), text
        assert "  " not in text.replace("\n  ", "\n"), text
        assert not re.search(r" [,.;:]|\(\)|: *$|[:,;]\.", text.replace(":\n", "\n")), text
    assert not COMPARING.search(names), names
    lines = [words_of(line) for line in signs.splitlines()]
    for line in names.splitlines():
        assert any(is_within(words_of(line), other) for other in lines), line
    document = answer.to_dict()
    assert answer.explain() == numbers == answer.explain(Depth.NUMBERS)
    assert document["sentences"] == numbers.splitlines()
    assert answer.to_dict("signs") == {**document, "sentences": signs.splitlines()}
    return signs


def less_or_more(difference, of):
    return 0 if abs(difference) <= 1e-9 * abs(of) else 1 if difference > 0 else -1


def worth(way, other):
    difference, off = way["shifted"] - other["shifted"], way["off"] + other["off"]
    sign = 0 if abs(difference) <= off else 1 if difference > 0 else -1
    return {-1: "worth less", 0: "worth as much", 1: "worth more"}[sign]


def check_verdicts(sentence, contrast, first, second):
    """The sentence names the better of two ways on each interval in order, as the JSON does."""
    better = [of["better"] for of in contrast["verdicts"]]
    called = {"best": first, "before": first, "trying": first}
    told = [called.get(name, second) for name in better]
    assert sentence.endswith("proved.") == contrast["decided"]
    if better == ["equal"]:
        assert "worth the same" in sentence
    elif len(better) == 1:
        assert f"for every gamma {told[0]} is worth more" in sentence
    else:
        spans = [f"{told[0]} for small gamma", *told[1:-1], f"{told[-1]} for large gamma"]
        assert f"worth more is {', then '.join(spans)}: proved" in sentence


@settings(deadline=None, max_examples=30)
@given(ENDS, MOTIONS)
def test_why(ends, motion):
    model = model_of(ends, motion)
    answer = qualrl.questions.why(model)
    signs, document = check_depths(answer), answer.to_dict()
    if answer.other is None:
        return
    best, other = document["best"], document["other"]
    assert f", {worth(other, best)}; it is" in signs
    assert f"it is {LONGER[less_or_more(other['length_m'] - best['length_m'], best['length_m'])]}" in signs
    told = re.findall(r"^  (.*), (.*): (for|against) it$", signs, re.MULTILINE)
    known = {(of["region"], of["kind"]): of["difference"] for of in document["entries"]}
    assert all((known[region, kind] > 0) == (side == "for") for region, kind, side in told)
    sizes = [abs(known[region, kind]) for region, kind, _ in told]
    assert sizes == sorted(sizes, reverse=True)
    if document["contrast"] is None:
        assert "undecided" in signs
    else:
        check_verdicts(signs.splitlines()[-1], document["contrast"], "the plan", "the next best")


@settings(deadline=None, max_examples=30)
@given(ENDS, MOTIONS, st.sampled_from(NAMES))
def test_why_not(ends, motion, via):
    try:
        answer = qualrl.questions.why_not(model_of(ends, motion), via)
    except NoPlanError:
        return
    signs, document = check_depths(answer), answer.to_dict()
    costs = worth(document["best"], document["by"]) == "worth more"
    assert (f"Going by {via} costs something: it is" in signs) == costs
    assert (f"So going by {via} costs nothing." in signs) == (not costs)
    if document["contrast"] is None:
        assert "undecided" in signs
    else:
        (verdict,) = [line for line in signs.splitlines() if line.startswith("Of these two ways")]
        check_verdicts(verdict, document["contrast"], "the best way", f"the way by {via}")
        seldom = [of["door"] for of in document["rather"] if costs and of["below"] is not None]
        assert re.findall(r"if (.*) were open seldom enough", signs) == seldom


@settings(deadline=None, max_examples=30)
@given(ENDS, MOTIONS, st.sampled_from(DOORS), st.sampled_from([None, 0.0, 0.4, 1.0]))
def test_what_if_a_doorway_closes(ends, motion, door, chance):
    model = model_of(ends, motion)
    answer = qualrl.questions.what_if(model, close=door, chance=None if motion["slip"] else chance)
    signs, document = check_depths(answer), answer.to_dict()
    assert f"With {door} closed: " in signs
    before, after = document["before"], document["after"]
    if after is None:
        assert "no way leads from" in signs
        return
    assert f", {worth(after, before)}" in signs.splitlines()[1]
    if document["trying"] is None:
        return
    gamma, ways = Fraction(document["gamma"]), answer.trying.break_even
    worths = [of.terms().items() for of in (ways.open, ways.closed, ways.round)]
    seen, unseen, around = (sum(share * gamma**power for power, share in terms) for terms in worths)
    words = {-1: "less", 0: "as much", 1: "more"}
    seen, unseen = (words[(of > around) - (of < around)] for of in (seen, unseen))
    assert f"going there is worth {seen} if it is open, {unseen} if it is not" in signs
    if document["trying"]["contrast"] is not None:
        check_verdicts(signs.splitlines()[-1], document["trying"]["contrast"], "trying", "going round")


@settings(deadline=None, max_examples=20)
@given(ENDS, MOTIONS, st.sampled_from([{"gamma": 0.6}, {"slip": 0.1}, {"goal_reward": 3.0}, {"step_reward": -9.0}]))
def test_what_if_a_number_changes(ends, motion, changed):
    answer = qualrl.questions.what_if(model_of(ends, motion), **changed)
    signs, document = check_depths(answer), answer.to_dict()
    (name,) = changed
    assert f"With {name} changed: " in signs
    assert ("is of another gamma" in signs) == (not answer.is_comparable)
    switch = document["switch"]
    assert (f"The best way changes with {name} as it" in signs) == (switch is not None)
    if switch is not None:
        assert f"as it {'grows' if switch['other'] > switch['same'] else 'falls'}." in signs
    if document["contrast"] is not None:
        check_verdicts(signs.splitlines()[-1], document["contrast"], "the old one", "the new one")


@pytest.mark.parametrize(("changed", "goes"), [({"gamma": 0.5}, "falls"), ({"slip": 0.4}, "grows")])
def test_what_if_tells_which_way_a_number_must_go(changed, goes):
    ends = ((9, 3), (2, 24)) if "gamma" in changed else ((1, 7), (8, 24))
    answer = qualrl.questions.what_if(model_of(ends, {"gamma": 0.95, "directions": 8}), **changed)
    (name,) = changed
    signs, document = check_depths(answer).splitlines(), answer.to_dict()
    assert f"The best way changes with {name} as it {goes}." in signs
    assert f"The best way changes with {name}." in answer.explain("names").splitlines()
    if document["contrast"] is not None:
        check_verdicts(signs[-1], document["contrast"], "the old one", "the new one")


@settings(deadline=None, max_examples=30)
@given(ENDS, MOTIONS)
def test_which_matters(ends, motion):
    answer = qualrl.questions.which_matters(model_of(ends, motion))
    signs, document = check_depths(answer), answer.to_dict()
    for loss in document["losses"]:
        (line,) = [line for line in signs.splitlines() if line.startswith(f"{loss['name']}: ")]
        if loss["loss"] is None:
            assert line.endswith("every way to the goal passes it")
            continue
        felt = (loss["loss"] > 0) - (loss["loss"] < 0)
        assert {-1: "something is gained", 0: "nothing is lost", 1: "something is lost"}[felt] in line
        assert ("not longer" in line) == (loss["longer_steps"] == 0)
    told = [line.split(":")[0] for line in signs.splitlines()[1:-1]]
    assert told == [of["name"] for of in document["losses"]] or not document["losses"]


@settings(deadline=None, max_examples=20)
@given(ENDS, MOTIONS)
def test_envision(ends, motion):
    answer = qualrl.questions.envision(model_of(ends, motion))
    signs, document = check_depths(answer), answer.to_dict()
    lines = signs.splitlines()[1:]
    for state, line in zip(document["states"], lines, strict=False):
        branches = [of for of in state["branches"] if of["most"] >= 0.001]
        kinds = re.findall(r"\((certain|almost certain|likely|possible)\)", line)
        bounds = [(of["least"], of["most"]) for of in branches]
        assert len(kinds) == len(bounds)
        for kind, (least, _) in zip(kinds, bounds, strict=True):
            known = ((1, "certain"), (math.nextafter(0.999, 1), "almost certain"), (math.nextafter(0.5, 1), "likely"))
            assert kind == next((word for bound, word in known if least >= bound), "possible")


@settings(deadline=None, max_examples=30)
@given(ENDS, MOTIONS)
def test_signs(ends, motion):
    answer = qualrl.questions.signs(model_of(ends, motion))
    signs, document = check_depths(answer), answer.to_dict()
    for influence, line in zip(document["influences"], signs.splitlines()[2:], strict=True):
        assert line.startswith(f"{influence['of']}: {influence['by_signs'].replace('0', 'none')} by signs alone")
        if influence["exact"] is not None and len(influence["exact"]["signs"]) > 1:
            first, *between, last = influence["exact"]["signs"]
            spans = [f"{first} for small gamma", *between, f"{last} for large gamma"]
            assert f"exactly: {', then '.join(spans)}, proved" in line
        elif influence["exact"] is not None:
            assert f"exactly: {influence['exact']['signs'][0].replace('0', 'none')} for every gamma, proved" in line
        elif influence["by_signs"] == "?":
            assert "undecided" in line


@settings(deadline=None, max_examples=20)
@given(ENDS, MOTIONS)
def test_summary(ends, motion):
    answer = qualrl.questions.summary(model_of(ends, motion))
    signs, document = check_depths(answer), answer.to_dict()
    most = ", ".join(document["important"][:3])
    assert signs.endswith(f"By the second-best doorway most is lost in {most}." if most else signs)
    assert [line.split(":")[0] for line in signs.splitlines()[1:5]] == [of["region"] for of in document["regions"]]


@pytest.mark.parametrize("between", ["corridor 1", "room A"])
@pytest.mark.parametrize("most_solved", [1000, 2])
def test_reconcile(monkeypatch, between, most_solved):
    monkeypatch.setattr(reconcile, "MOST_SOLVED", most_solved)
    model = model_of(((2, 2), (2, 24)), {"gamma": 0.95})
    answer = qualrl.questions.reconcile(model, ["room B", between, "room C"])
    signs, document = check_depths(answer), answer.to_dict()
    assert f", {worth(document['own'], document['best'])}; it is" in signs
    assert ("undecided" in signs) == (document["closed"] != [] and not document["smallest"])


def test_opened_walls_are_told_without_their_place():
    regions = qualrl.segment(grid_of(THREE_ROOMS))
    left, middle, right = (regions.region_names[regions.label[cell]] for cell in ((2, 2), (2, 10), (2, 18)))
    model = qualrl.build(regions, [2, 18], start=[2, 2], gamma=0.97)
    passages = f"passage 1 opened from {left} to {middle}, passage 2 opened from {middle} to {right}"
    answer = qualrl.questions.reconcile(model, [left, middle, right])
    assert f"\nIt would be best with {passages}.\n" in check_depths(answer, regions) + "\n"
    answer = qualrl.questions.what_if(model, open=(left, middle))
    told = f"With passage 1 opened from {left} to {middle}: the same way, worth as much."
    assert check_depths(answer, regions).splitlines()[1] == told


def test_intervals_are_told_in_their_order():
    corridor = Course((Stretch("corridor", 39, -1.0), Stretch("corridor", 1, 200.0)))
    lab = Course((Stretch("hall", 22, -1.0), Stretch("lab", 9, -3.0), Stretch("lab", 1, 200.0)))
    assert contrast(corridor, lab).in_words("the corridor", "the lab", has_numbers=False) == (
        "worth more is the corridor for small gamma, then the lab, then the corridor for large gamma: proved"
    )


@MAPPED
@given(blocked_maps(radii=(0.0, 0.8, 1.2)))
def test_why_unreachable(case):
    model, answer = asked(case)
    check_depths(answer, model.regions)


@pytest.mark.parametrize("closed", [["door 1"], DOORS])
def test_why_unreachable_with_closed_doorways(closed):
    model = model_of(((2, 2), (2, 24)), {"gamma": 0.95})
    answer = qualrl.questions.why_unreachable(model.with_closed(closed))
    signs = check_depths(answer)
    assert ("door 1 and door 2 opened." in signs) == (not answer.is_reachable)
    assert all(name in signs for place in answer.crossings for name in (*place.between, place.door))


def test_other_thresholds_are_higher(tmp_path):
    written(tmp_path, np.array([[254, 254, 205, 120, 254, 254]] * 3, np.uint8))
    regions = qualrl.segment(qualrl.read_map(tmp_path / "m.yaml"))
    answer = qualrl.questions.why_unreachable(qualrl.build(regions, [0, 5], start=[0, 0]))
    check_depths(answer, regions)
    assert "- another free_thresh in the map, which frees" in answer.explain("names")
    assert "- another, higher free_thresh in the map, which frees" in answer.explain("signs")
    assert "Careful: the map does not know" in answer.explain("names")


@settings(deadline=None, max_examples=25)
@given(st.data(), free_masks(side=9), MOTIONS)
def test_all_answers_on_random_maps(data, free, motion):
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    ends = data.draw(st.permutations(cells))[:2]
    regions = qualrl.segment(qualrl.OccupancyGrid.from_free(free))
    model = qualrl.build(regions, list(ends[-1]), start=list(ends[0]), **motion)
    questions = qualrl.questions
    found = [questions.why(model), questions.envision(model), questions.summary(model)]
    found += [questions.signs(model)] if ends[0] != ends[-1] else []
    found += [questions.which_matters(model), questions.what_if(model, gamma=0.7)]
    doors = [door.name for door in regions.doorways]
    if doors:
        closed = data.draw(st.sampled_from(doors))
        found += [questions.what_if(model, close=closed), questions.why_unreachable(model.with_closed(doors))]
    if doors and not motion["slip"]:
        found.append(questions.robust(model, doors={closed: (0.2, 0.9)}, times={"*": (1.0, 2.0)}))
    for answer in found:
        check_depths(answer, regions)


def test_an_unknown_depth_is_refused_and_the_known_are_told():
    answer = qualrl.questions.summary(model_of(((2, 2), (2, 24)), {"gamma": 0.95}))
    with pytest.raises(SettingError, match=r"^depth must be one of names, signs, numbers, got 'deep'$"):
        answer.explain("deep")
    with pytest.raises(SettingError, match="got 'NAMES'"):
        answer.to_dict("NAMES")


@pytest.fixture
def here(tmp_path):
    draw(tmp_path, "loop", LOOP)
    (tmp_path / "loop.scenario.yaml").write_text(
        "map: loop.yaml\nstart: [2, 2]\ngoal: [2, 24]\nlearn: {episodes: 20, gamma: 0.95}\n"
    )
    return tmp_path


@pytest.mark.parametrize(
    "question",
    [
        ["why"], ["why-not", "--via", "room A"], ["what-if", "--set", "motion.slip=0.2"], ["which-matters"],
        ["why-unreachable"], ["reconcile", "--expect", "room B, corridor 1, room C"], ["signs"], ["envision"],
        ["summary"], ["robust", "--chance", "door 1=0.5..0.9"],
    ],
)  # fmt: skip
def test_each_command_takes_a_depth(here, question):
    name, *options = question
    document = json.loads(qualrl_command(name, "loop.scenario.yaml", *options, "--json", cwd=here)[0])
    for depth in ("names", "signs", "numbers"):
        asked = name, "loop.scenario.yaml", *options, "--depth", depth
        told = json.loads(qualrl_command(*asked, "--json", cwd=here)[0])
        assert qualrl_command(*asked, cwd=here)[0].splitlines() == told["sentences"]
        assert told == {**document, "sentences": told["sentences"]}
        assert (told == document) == (depth == "numbers")
    error = qualrl_command(name, "loop.scenario.yaml", *options, "--depth", "deep", cwd=here, expect=2)[1]
    assert "Value error" not in error
    assert "Input should" not in error
    assert error.count("\n") == 1
    assert all(depth in error for depth in ("names", "signs", "numbers"))


def test_how_sure_takes_a_depth(here):
    qualrl_command("learn", "loop.scenario.yaml", "-o", "out", cwd=here)
    told = qualrl_command("how-sure", "out", "--depth", "names", cwd=here)[0]
    assert "room A: all of the states visited" in told
    assert not re.search(r"\d", re.sub("corridor 1", "", told))


def test_a_changed_setting_is_told_by_its_name(here):
    asked = "what-if", "loop.scenario.yaml", "--set", "learn.gamma=0.9", "--slip", "0.1", "--depth", "signs"
    assert "\nWith learn.gamma changed, motion.slip changed: " in qualrl_command(*asked, cwd=here)[0]
