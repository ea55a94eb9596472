"""One short file per stage of the DAG: read inputs, call the library, write outputs."""
