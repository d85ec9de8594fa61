from .findings import LearningReport as LearningReport
from .findings import remarks as remarks
from .learner import ArrayLearner as ArrayLearner
from .learner import Learnt as Learnt
from .learner import learn_arrays as learn_arrays
from .parts import Learner as Learner
from .parts import read_or_collect as read_or_collect
from .settings import LearningSettings as LearningSettings
