"""``python -m pipeline.dvc``: DVC as it is, with less overhead. Every command and option is DVC's.

* `lock_file`: ``dvc.lock`` is written entry by entry;
* `checked_params`: parameters that ``conf/`` does not give, or whose code ``dvc.yaml`` does not list, are refused;
* `read_once`: parameters are parsed and files hashed once, not once per stage;
* `preloaded`: stages run in children of one process that has the libraries loaded;
* `pipeline.freed_memory`: memory that a stage frees is kept for its next arrays;
* `at_once`: stages that do not depend on each other run at once;
* `end_with_parent`: no command outlives a ``dvc repro`` that is killed.

The same results and the same bytes of ``dvc.lock``; ``dvc`` itself may be used before and after.
"""
