"""A frame analysed for ``health`` and ``watch``: its condition as a row of numbers, flags, alarms, and all in words."""
