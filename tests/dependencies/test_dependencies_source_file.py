"""What one source file refers to."""

import pytest

from pipeline.dependencies.source_file import read_source
from pipeline.errors import InputError


@pytest.mark.parametrize(
    ("line", "package", "base"),
    [
        ("from . import sensor", False, "pipeline.camera"),
        ("from . import sensor", True, "pipeline.camera.chain"),
        ("from ..noise import pca", False, "pipeline.noise"),
        ("from pipeline.noise import pca", False, "pipeline.noise"),
    ],
)
def test_relative_imports_lead_to_the_modules_that_they_name(line, package, base):
    (imported,) = read_source(line, "pipeline.camera.chain", package).froms
    assert imported == (base, line.rpartition(" ")[2])


def test_imports_for_types_only_do_not_count_but_their_alternative_does():
    text = "if TYPE_CHECKING:\n    import a\nelse:\n    import b\ndef f():\n    import c\n"
    assert read_source(text, "pipeline.x").imports == {"b", "c"}


def test_imports_by_name_and_by_a_computed_name():
    text = "import importlib\nimportlib.import_module('pipeline.a')\n__import__(name)\n"
    source = read_source(text, "pipeline.x")
    assert source.imports == {"importlib", "pipeline.a"}
    assert source.computed == (3,)
    assert read_source(text, "pipeline.registry").computed == ()


def test_registries_and_files_that_are_named():
    text = (
        "R = Registry('noise estimator', 'pipeline.noise', {'pca': 'pipeline.noise.pca:Pca'})\n"
        "W, other = 'data/weights/mtf_cnn.safetensors', 'data/other.csv'\n"
        "importlib.resources.files(__package__)\n"
    )
    source = read_source(text, "pipeline.noise", True)
    assert source.registries == {"pipeline.noise": {"pca": "pipeline.noise.pca"}}
    assert source.data == {"data/weights/mtf_cnn.safetensors"}
    assert source.whole_folder


def test_a_registry_with_computed_entries_is_refused_with_its_line():
    with pytest.raises(InputError, match="line 2: expected Registry"):
        read_source("\nR = Registry('noise', 'pipeline.noise', entries())\n", "pipeline.noise", True)
