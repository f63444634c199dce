"""Operations without an operator: procedures, their execution, and the state of the station.

The model is the Link Monitor and Control Operator Assistant of JPL (LMCOA, TDA PR 42-112): a
procedure is a network of blocks of directives; a directive counts as done when the station shows
the expected state, never when its response arrives.
"""

from typing import TYPE_CHECKING

from rf_pointing.core.lazy import lazily

if TYPE_CHECKING:
    from rf_pointing.operations.alarms import AlarmParams
    from rf_pointing.operations.executor import BlockState, Executor, JournalEntry
    from rf_pointing.operations.expected_state import Condition, ExpectedState
    from rf_pointing.operations.procedure import Block, Directive, Procedure, read_procedure
    from rf_pointing.operations.schedule import BetweenParams

__getattr__ = lazily(__name__, __file__)
