"""How much of a large frame is measured: ``--tiles`` for noise and ``--patches`` for blur, the same in every command.

The defaults are `ConditionMonitor`'s; they are repeated here because its module loads torch, which ``--help`` need not.
"""

from __future__ import annotations

import click

tiles_option = click.option(
    "--tiles", "most_tiles", default=54, show_default=True, type=click.IntRange(min=1),
    help="most tiles of a frame for its noise; where more would cover it, an even selection",
)  # fmt: skip
patches_option = click.option(
    "--patches", "most_patches", default=28, show_default=True, type=click.IntRange(min=1),
    help="most patches of a frame for its blur; where more would cover it, an even selection",
)  # fmt: skip
