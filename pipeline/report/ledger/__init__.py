"""The ledger: every published number beside ours; its rows and verdicts, its items, their sources and causes."""
