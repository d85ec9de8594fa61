from .judging import judge as judge
from .programs import Opened as Opened
from .programs import opened as opened
from .programs import opened_tree as opened_tree
from .trees import Ensemble as Ensemble
