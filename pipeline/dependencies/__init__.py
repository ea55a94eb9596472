"""Which source and data files a module can execute or open, and whether ``dvc.yaml`` declares them.

`pipeline.dependencies.closure` computes the import closure of a module from source, and fingerprints for caches from
it; `pipeline.dependencies.dvc_yaml` compares the closure of every stage with its ``deps`` or writes them
(``python -m pipeline.dependencies --check | --write``).
"""
