"""Losses in words, and the error with which a writer refuses them."""

from __future__ import annotations

from collections.abc import Sequence

from fuzzytree.errors import LossError
from fuzzytree.model.contracts import Loss


def loss_text(loss: Loss) -> str:
    """Return a loss as people read it, with its bound.

    Example:
        >>> loss_text(Loss("term 'low' of 'force'", "becomes 9 points", 1e-3))
        "term 'low' of 'force': becomes 9 points (largest error 0.001)"
    """
    bound = "" if loss.bound is None else f" (largest error {loss.bound:.2g})"
    return f"{loss.where}: {loss.what}{bound}"


def refusal(model: str, to: str, losses: Sequence[Loss]) -> LossError:
    """Return the error with which a writer refuses to lose something.

    Args:
        model: The name of the model.
        to: The name of the format.
        losses: Everything that would be lost.

    Example:
        >>> print(refusal("grip", "turtle", [Loss("AND", "a product becomes min")]))
        cannot write grip as turtle without loss:
          AND: a product becomes min
          pass allow_loss=True to write it as stated
    """
    listed = "".join(f"  {loss_text(loss)}\n" for loss in losses)
    return LossError(
        f"cannot write {model[:100]} as {to} without loss:\n{listed}"
        "  pass allow_loss=True to write it as stated"
    )


def narrowing_refusal(model: str, to: str, losses: Sequence[Loss]) -> LossError:
    """Return the error with which a writer refuses to narrow numbers.

    Args:
        model: The name of the model.
        to: The name of the format and the number type.
        losses: Everything that would be lost; the first ten are listed.
    """
    lines = [f"{loss.where}: {loss.what}" for loss in losses[:10]]
    if len(losses) > 10:
        lines.append(f"and {len(losses) - 10} more")
    lines.append(
        "pass allow_loss=True to write it as stated, or choose dtype 'float64'"
    )
    return LossError(f"cannot write {model} as {to}: " + "\n  ".join(lines))
