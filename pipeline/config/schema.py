"""What may be set, in which unit and range: the strict schema of ``params.yaml``.

Sections are named as in ``conf/``. An unknown key, a wrong type or a value out of range is one line that names
the key and, for a typo, the nearest key.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from pipeline.config.schema_base import Count, Frequency, Level, Name, NonNegative, Positive, Section, Share
from pipeline.config.schema_detection import DetectionSection
from pipeline.errors import InputError, did_you_mean

__all__ = ["Config", "Name", "Section", "known_keys", "validate"]


class SensorSection(BaseModel):
    """A sensor by name; any parameter of `pipeline.camera.sensor.Sensor` may be changed beside it."""

    model_config = ConfigDict(extra="allow", frozen=True)

    model: Name


class CameraSection(Section):
    """The camera that forms corrupted images."""

    kind: Literal["physical", "authors", "authors_2022"]
    poisson: Literal["exact", "hybrid"]
    order: Literal["paper", "detector"] = "paper"
    light: Literal["encoded", "linear"] = "encoded"
    sensor: SensorSection


class PsfSection(Section):
    """The bank of point spread functions (PSF)."""

    source: Literal["generated", "paper"]
    folder: str | None
    match: Literal["nominal", "paper"]
    kinds: list[Literal["defocus", "linear_motion", "nonlinear_motion"]] = Field(min_length=1)
    sizes_px: list[Annotated[int, Field(ge=1, le=55)]] = Field(min_length=1)
    angles_deg: list[Annotated[float, Field(ge=0, lt=360)]] = Field(min_length=1)

    @model_validator(mode="after")
    def _folder_with_paper(self) -> PsfSection:
        if self.source == "paper" and not self.folder:
            raise ValueError("psf.folder must name the folder of the paper's kernels when psf.source is 'paper'")
        return self


class ScenesSection(Section):
    """How much of the *Sim* dataset is rendered, and how finely."""

    viewpoints: Count
    samples: Annotated[int, Field(ge=1, le=8)]
    width_px: Annotated[int, Field(ge=64, le=4096)]
    height_px: Annotated[int, Field(ge=64, le=4096)]
    radiance: bool
    star_periods: Annotated[int, Field(ge=8, le=360)]
    star_frequencies: list[Frequency] = Field(min_length=1)


class DatasetSection(Section):
    """One dataset: which reader, where it lies, how much of it is used."""

    kind: Name
    root: str | None
    watch: str
    limit: Count | None = None
    whitelist: str | None = None
    max_bad_share: Share = 0.05
    options: dict[str, Any] = Field(default_factory=dict)


class GallerySection(Section):
    """The picture of the image-formation chain."""

    sigma_dn: Level
    kernel_size_px: Annotated[int, Field(ge=1, le=55)]
    crop_px: Annotated[int, Field(ge=32, le=1024)]


class CorruptionSection(Section):
    """Which effects at which levels."""

    effects: list[Literal["photon", "dcsn", "readout", "combined"]] = Field(min_length=1)
    levels_dn: list[Level] = Field(min_length=1)
    gallery: GallerySection


class EstimatorSection(Section):
    """One estimator by its registry name, with the options its class takes."""

    kind: Name
    options: dict[str, Any] = Field(default_factory=dict)
    per_frame: Count | None = None
    """Patches or tiles of a frame that a slow one is run on, where that is fewer than all are."""
    camera_samples: Annotated[int, Field(ge=100, le=100_000)] | None = None
    """Blurred sharp patches that a blur estimator is fitted to each dataset's camera on; null leaves it as it is."""

    @property
    def answers_added(self) -> bool:
        """Whether a blur estimator tells what was added to sharp frames, this camera's or a typical one's."""
        return self.camera_samples is not None or self.options.get("answer") == "added"


class NoiseSection(Section):
    """The evaluation of noise estimators."""

    tile_px: Annotated[int, Field(ge=16, le=1024)]
    tiles_per_frame: Count | None
    bootstrap_draws: Annotated[int, Field(ge=1, le=100_000)]
    map_level_dn: Level
    estimators: dict[Name, EstimatorSection] = Field(min_length=1)


class BlurSection(Section):
    """The evaluation of blur estimators."""

    patch_px: Annotated[int, Field(ge=32, le=1024)]
    patches_per_frame: Count | None
    bootstrap_draws: Annotated[int, Field(ge=1, le=100_000)]
    estimators: dict[Name, EstimatorSection] = Field(min_length=1)


class ExperimentSection(Section):
    """Blur and noise that come together; each enters at its own place in the camera."""

    kind: Literal["defocus", "linear_motion", "nonlinear_motion"]
    effect: Literal["photon", "dcsn", "readout", "combined", "sensor"]


class SubsetSection(Section):
    """The part of the experiments that one blur estimator is run on; what is left out is not restricted."""

    frames: Count | None = None
    sizes_px: list[Positive] | None = None
    angles_deg: list[NonNegative] | None = None
    levels_dn: list[Level] | None = None
    experiments: list[Name] | None = None


class DenoiseSection(Section):
    """Denoise, then estimate; see `pipeline.blur.denoise`. Without a filter it is left out."""

    filter_px: Annotated[float, Field(gt=1, le=31)] | None
    from_sigma_dn: NonNegative
    sigma_by: Name


class CombinedSection(Section):
    """Blur and noise at once; see `pipeline.condition.combined`."""

    experiments: dict[Name, ExperimentSection] = Field(min_length=1)
    sizes_px: list[Positive] = Field(min_length=1)
    levels_dn: list[Level] = Field(min_length=1)
    frames: Count | None
    patches_per_frame: Count | None
    tiles_per_frame: Count | None
    noise_estimators: list[Name]
    blur_estimators: dict[Name, SubsetSection]
    denoise: DenoiseSection
    example_px: Positive
    bootstrap_draws: Annotated[int, Field(ge=1, le=100_000)]


class DenoisedBlurSection(Section):
    """The supplement's table of improved blur estimation under noise."""

    kind: Literal["defocus", "linear_motion", "nonlinear_motion"]
    effect: Literal["photon", "dcsn", "readout", "combined", "sensor"]
    sizes_px: list[Positive] = Field(min_length=1)
    levels_dn: list[Annotated[float, Field(gt=0, le=100)]] = Field(min_length=1)
    filters_px: list[Annotated[float, Field(gt=1, le=31)]] = Field(min_length=1)
    frames: Count | None
    patches_per_frame: Count | None
    blur_estimators: list[Name] = Field(min_length=1)
    bootstrap_draws: Annotated[int, Field(ge=1, le=100_000)]


class ScheduleSection(Section):
    """The optimiser of a training; see `pipeline.learning.trainer.Schedule`."""

    steps: Count
    learning_rate: Positive
    optimiser: Literal["adamw", "adam"]
    betas: tuple[Annotated[float, Field(ge=0, lt=1)], Annotated[float, Field(ge=0, lt=1)]]
    epsilon: Positive
    weight_decay: NonNegative
    warm_up: Count
    hold: Annotated[float, Field(ge=0, lt=1)]
    final_share: Share
    average_decay: Annotated[float, Field(ge=0, lt=1)]
    clip: Positive | None
    checkpoint_every: Count
    report_every: Count


class RecipeSection(Section):
    """What training samples are drawn from; see `pipeline.learning.samples.Recipe`."""

    views: Count
    kernels_per_view: Count
    anisotropy: Share
    intrinsic_px: tuple[NonNegative, NonNegative]
    clean_share: Share
    before_share: Share
    largest_sigma_dn: Annotated[float, Field(gt=1, le=100)]
    camera_fraction: Share


class MtfTrainingSection(Section):
    """The training of one blur network; see `pipeline.learning.training.Training`."""

    schedule: ScheduleSection
    recipe: RecipeSection
    images: Count
    validation_images: Count
    kernels: Count
    kernel_distribution: Literal["paper_like", "with_optics"]
    fresh: Count
    uses: Count
    window: Count
    validation_chunks: Count
    half_precision: bool


class NoiseRecipeSection(Section):
    """What the noise networks' samples are drawn from; see `pipeline.noise.samples.Recipe`."""

    size_px: Annotated[int, Field(ge=16, le=256, multiple_of=8)]
    views: Count
    noises: Count
    sigma_dn: tuple[Level, Level]
    clean_share: Share
    low_share: Share
    texture_share: Share
    blurred_noise_share: Share
    interpolated_share: Share
    compressed_share: Share
    sources: Literal["any", "mixed"]


class SigmaTrainingSection(Section):
    """A training of a noise network; see `pipeline.noise.training.Settings`."""

    schedule: ScheduleSection
    recipe: NoiseRecipeSection
    images: Count
    validation_images: Count
    fresh: Count
    uses: Count
    window: Count
    validation_chunks: Count


class AblationVariantSection(Section):
    """What one short training changes; None changes nothing. See `pipeline.blur.ablation`."""

    seed: Annotated[int, Field(ge=0, lt=2**63)] | None = None
    images: Count | None = None
    kernels: Count | None = None
    uses: Count | None = None
    anisotropy: Share | None = None
    intrinsic_px: tuple[NonNegative, NonNegative] | None = None
    clean_share: Share | None = None
    before_share: Share | None = None


class AblationSection(Section):
    """Short trainings of the spectral network that differ in one thing each."""

    steps: Annotated[int, Field(ge=2)]
    images: Count
    kernels: Count
    variants: dict[Name, AblationVariantSection] = Field(min_length=1)


class CropRecipeSection(Section):
    """How a detector's samples are cut; see `pipeline.detection.compact.samples.CropRecipe`."""

    size_px: Annotated[int, Field(ge=64, le=1024, multiple_of=32)]
    count: Count
    scale: tuple[Positive, Positive]
    at_object: Share


class DetectorTrainingSection(Section):
    """A training of a compact detector; see `pipeline.detection.compact.training.DetectorTraining`."""

    schedule: ScheduleSection
    recipe: CropRecipeSection
    frames: Count
    validation_frames: Count
    rays: Annotated[int, Field(ge=1, le=8)]
    width_px: Annotated[int, Field(ge=32, le=4096)]
    height_px: Annotated[int, Field(ge=32, le=4096)]
    uses: Count
    window: Count
    half_precision: bool


class TypicalCameraSection(Section):
    """What the spectral estimator is fitted to cameras at large on; see `pipeline.blur.typical_camera`."""

    images: Count
    patches: Count
    samples: Annotated[int, Field(ge=100, le=100_000)]
    intrinsic_px: tuple[NonNegative, NonNegative]


class TrainSection(Section):
    """Trainings by what they estimate or find."""

    mtf: dict[Literal["spectral", "cnn"], MtfTrainingSection]
    typical_camera: TypicalCameraSection
    sigma: dict[Literal["cellwise", "cnn"], SigmaTrainingSection]
    detector: dict[Literal["compact", "compact_two_stage"], DetectorTrainingSection]


class ExecutorSection(Section):
    """Where parallel work runs; changes no result. ``workers: 0`` means one per core."""

    backend: Literal["processes", "dask"]
    workers: Annotated[int, Field(ge=0, le=1024)]
    address: str | None


class ReportSection(Section):
    """What the report says of datasets and detectors that were not run: name -> the line that would run it."""

    not_run: dict[str, str]
    not_run_detectors: dict[str, str]
    example_frames: Annotated[int, Field(ge=1, le=8)]


class MatrixSection(Section):
    """Lists that ``dvc.yaml`` expands into stages; derived from the sections above, not set by hand."""

    datasets: list[Name]
    noise_estimators: list[Name]
    blur_estimators: list[Name]
    ablations: list[Name]
    detectors: list[Name]
    detection_datasets: list[Name]


class Config(Section):
    """The whole of ``params.yaml``."""

    profile: Literal["smoke", "default", "paper"]
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    camera: CameraSection
    psf: PsfSection
    scenes: ScenesSection
    datasets: dict[Name, DatasetSection] = Field(min_length=1)
    corruption: CorruptionSection
    blur: BlurSection
    combined: CombinedSection
    denoised_blur: DenoisedBlurSection
    detection: DetectionSection
    train: TrainSection
    ablation: AblationSection
    noise: NoiseSection
    executor: ExecutorSection
    report: ReportSection
    matrix: MatrixSection

    @model_validator(mode="after")
    def _matrix_follows(self) -> Config:
        for key, listed, defined in (
            ("matrix.datasets", self.matrix.datasets, list(self.datasets)),
            ("matrix.noise_estimators", self.matrix.noise_estimators, list(self.noise.estimators)),
            ("matrix.blur_estimators", self.matrix.blur_estimators, list(self.blur.estimators)),
            ("matrix.detectors", self.matrix.detectors, list(self.detection.detectors)),
            ("matrix.detection_datasets", self.matrix.detection_datasets, list(self.detection.datasets)),
        ):
            if listed != defined:
                raise ValueError(f"{key} is {listed} but should follow {defined}; it is derived, do not set it")
        unknown = set(self.matrix.ablations) - set(self.ablation.variants)
        if unknown:
            raise ValueError(f"matrix.ablations: {sorted(unknown)} are not in ablation.variants")
        return self


def validate(content: Mapping[str, Any], where: str = "params.yaml") -> Config:
    """Check a configuration.

    Args:
        content: nested mapping, as read from YAML.
        where: file or source named in the message.

    Returns:
        the typed configuration.

    Raises:
        InputError: one line per problem, each naming its key, what was expected and what was given.
    """
    if not isinstance(content, Mapping):
        raise InputError(f"{where}: expected a mapping of sections, got {type(content).__name__}")
    try:
        return Config.model_validate(dict(content))
    except ValidationError as error:
        raise InputError("\n".join(f"{where}: {_line(problem)}" for problem in error.errors())) from None


def _line(problem: Any) -> str:
    path = ".".join(str(part) for part in problem["loc"] if part != "[key]")
    if problem["type"] == "extra_forbidden":
        return f"unknown key '{path}'; {did_you_mean(str(problem['loc'][-1]), known_keys(problem['loc'][:-1]))}"
    if problem["type"] == "missing":
        return f"'{path}' is missing"
    given = problem.get("input")
    shown = f" (given: {given!r})" if isinstance(given, (str, int, float, bool, type(None))) else ""
    message = str(problem["msg"]).removeprefix("Value error, ")
    key = f"'{path}': " if path else ""
    return f"{key}{message[:1].lower()}{message[1:]}{shown if path else ''}"


def known_keys(path: Sequence[Any]) -> list[str]:
    """Keys the schema knows at a path; mapping members (datasets, estimators) count as one step."""
    model: Any = Config
    for part in path:
        field = model.model_fields.get(part) if hasattr(model, "model_fields") else None
        annotation = field.annotation if field is not None else model
        inner = [a for a in getattr(annotation, "__args__", ()) if isinstance(a, type) and issubclass(a, BaseModel)]
        model = inner[0] if inner else annotation
    return list(getattr(model, "model_fields", {}))
