"""What acts on the walker that its model does not know: a push, a load, a slope; `observer` says how it is told."""

from controller.observer.observer import Estimate, PushObserver
from controller.observer.service import Observed

__all__ = ["Estimate", "Observed", "PushObserver"]
