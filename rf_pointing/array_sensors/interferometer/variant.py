"""Choice between the report's printed formula and its correction.

Every function that corrects a misprint or a modelling slip of the report takes `variant`:
"published" gives what the report printed or its listing computed, "corrected" what follows from its
own definitions.
"""

from rf_pointing.core import require_choice

PUBLISHED = "published"
CORRECTED = "corrected"
VARIANTS = (PUBLISHED, CORRECTED)


def is_published(variant: str) -> bool:
    """Return whether `variant` is the printed form; raise ValueError for an unknown name."""
    require_choice("variant", variant, VARIANTS)
    return variant == PUBLISHED
