"""What depends on a model alone: made once, and shared by all who ask, over threads too."""

from collections.abc import Callable, Hashable
from functools import wraps
from threading import RLock
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from qualrl.models.hybrid_mdp import HybridMDP

Found = TypeVar("Found")


def once(make: Callable[..., Found]) -> Callable[..., Found]:
    """Keep what a function makes of a model, and of hashable arguments after it, for as long as the model is.

    Whoever asks while it is made waits for it.  It is shared: nobody may write to it, and it must not hold the model.
    """
    kept: WeakKeyDictionary[HybridMDP, dict[tuple[Hashable, ...], Any]] = WeakKeyDictionary()
    turn = RLock()

    @wraps(make)
    def found(model: HybridMDP, *more: Hashable) -> Found:
        with turn:
            of_model = kept.setdefault(model, {})
            if more not in of_model:
                of_model[more] = make(model, *more)
            result: Found = of_model[more]
            return result

    return found
