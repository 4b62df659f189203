"""Everything that can go wrong for a user, as one tree; each class carries its exit code.

| class             | exit code | meaning                                                   |
|-------------------|-----------|-----------------------------------------------------------|
| `UsageError`      | 2         | the command line contradicts itself                       |
| `InputError`      | 3         | the input cannot be used                                  |
| `OutputError`     | 4         | the output cannot be written                              |
| `MissingExtraError` | 6       | an optional part of planish is not installed              |

A message names the thing, what was found, what was wanted and what to do, in one line.
"""


class PlanishError(Exception):
    """Whatever planish itself refuses; catch this to catch them all."""

    exit_code = 1


class UsageError(PlanishError):
    """The command line or the arguments contradict each other."""

    exit_code = 2


class InputError(PlanishError):
    """The input cannot be used: missing, broken, or not a scan of a sheet."""

    exit_code = 3


class OutputError(PlanishError):
    """The output cannot be written: no folder, no permission, no room."""

    exit_code = 4


class MissingExtraError(PlanishError):
    """An optional part of planish is needed and not installed."""

    exit_code = 6
