"""Bounds of what one plan is worth more than another, narrower than those of the two apart.

What both have in common cancels: legs in the same regions, whether at the same point of the plans or not, and what is
done at the same doorways.  A *weight* is what stands before a part of a plan: a product of discounts and of legs.
"""

from dataclasses import dataclass, field, replace

from qualrl.qualitative.outlook import NOTHING, Bounds, Box, Number, Outlook, mixed, moved


@dataclass(frozen=True)
class _Weight:
    """A factor times leg^(f - 1) for each of some times f."""

    factor: float = 1.0
    legs: dict[str, float] = field(default_factory=dict)
    """By key."""

    def times(self, number: Number) -> "_Weight":
        """With one more leg."""
        assert number.leg is not None
        return replace(self, legs={**self.legs, number.key: self.legs.get(number.key, 1.0) * number.leg})

    def without(self, common: dict[str, float]) -> "_Weight":
        """With legs divided out."""
        rest = {key: leg / common.get(key, 1.0) for key, leg in self.legs.items()}
        return replace(self, legs={key: leg for key, leg in rest.items() if leg != 1.0})

    def on(self, bounds: Bounds, box: Box) -> Bounds:
        """Bounds of something with this weight."""
        bounds = moved(0.0, self.factor, bounds)
        for key, leg in self.legs.items():
            bounds = mixed(Number(key, leg), box, bounds, NOTHING)
        return bounds


def difference(first: Outlook | None, second: Outlook | None, box: Box) -> Bounds:
    """Bounds of what the first is worth more than the second."""
    return _difference(_Weight(), first, _Weight(), second, box)


def _difference(
    weight: _Weight, first: Outlook | None, other_weight: _Weight, second: Outlook | None, box: Box
) -> Bounds:  # fmt: skip
    weight, first = _absorbed(weight, first)
    other_weight, second = _absorbed(other_weight, second)
    shared = weight.legs.keys() & other_weight.legs.keys()
    common = {key: max(weight.legs[key], other_weight.legs[key]) for key in shared}
    found = _apart(weight.without(common), first, other_weight.without(common), second, box)
    return _Weight(1.0, common).on(found, box)


def _absorbed(weight: _Weight, plan: Outlook | None) -> tuple[_Weight, Outlook | None]:
    """The same with legs, and steps that are paid nothing, moved into the weight."""
    while plan is not None:
        if plan.number is not None and plan.number.leg is not None and plan.instead is None:
            weight, plan = weight.times(plan.number), replace(plan, number=None)
        elif plan.number is None and plan.reward == 0:
            weight, plan = replace(weight, factor=weight.factor * plan.discount), plan.then
        else:
            break
    return weight, plan


def _apart(
    weight: _Weight, first: Outlook | None, other_weight: _Weight, second: Outlook | None, box: Box
) -> Bounds:  # fmt: skip
    """The same, where the weights have no leg in common and both plans begin with a doorway or with what is paid."""
    if first is not None and second is not None and first.number == second.number:
        ahead = _onward(weight, first, other_weight, second, box)
        back = _difference(weight, first.instead, other_weight, second.instead, box)
        return mixed(first.number, box, ahead, back)
    if first is not None and first.number is None:
        return _sum(weight.on(_sure(first.reward), box), _difference(*_rest(weight, first), other_weight, second, box))
    if second is not None and second.number is None:
        paid = other_weight.on(_sure(-second.reward), box)
        return _sum(paid, _difference(weight, first, *_rest(other_weight, second), box))
    low, high, at_low, at_high = NOTHING if first is None else weight.on(first.bounds(box), box)
    least, most, at_least, at_most = NOTHING if second is None else other_weight.on(second.bounds(box), box)
    return low - most, high - least, {**at_most, **at_low}, {**at_least, **at_high}


def _onward(weight: _Weight, first: Outlook, other_weight: _Weight, second: Outlook, box: Box) -> Bounds:
    """Of the two parts beyond a doorway, or after what is paid."""
    if weight == other_weight:
        paid = weight.on(_sure(first.reward - second.reward), box)
    else:
        paid = _sum(weight.on(_sure(first.reward), box), other_weight.on(_sure(-second.reward), box))
    return _sum(paid, _difference(*_rest(weight, first), *_rest(other_weight, second), box))


def _rest(weight: _Weight, plan: Outlook) -> tuple[_Weight, Outlook | None]:
    return replace(weight, factor=weight.factor * plan.discount), plan.then


def _sure(amount: float) -> Bounds:
    return amount, amount, {}, {}


def _sum(one: Bounds, other: Bounds) -> Bounds:
    return one[0] + other[0], one[1] + other[1], {**one[2], **other[2]}, {**one[3], **other[3]}
