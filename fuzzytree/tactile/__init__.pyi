from .features.names import names_of as names_of
from .recognition.sensing import open as open
from .runtimes.frames import features_of as features_of
