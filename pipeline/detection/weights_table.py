"""PublishedFile weight files of detectors: where they lie, how large they are, and what their bytes hash to.

Data only; `pipeline.downloads` fetches them. Sources of the hashes:

- ``yolox_nano``: the release asset, as several public projects that pin it record it.
- ``yolox_nano_reexport``: another export of the same network, 18,949 bytes larger, in a public repository; the numbers
  of this project's tests were measured with it.
- ``yolov4``, ``faster_rcnn``: the Git LFS pointers (and for YOLOv4 the hub manifest) of github.com/onnx/models, whose
  files have moved to the Model Zoo's place at Hugging Face.
- ``yolov7``: the authors publish the checkpoint without a hash, and no ONNX file; it has to be exported.
"""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.downloads import PublishedFile


@dataclass(frozen=True, kw_only=True)
class PublishedWeights(PublishedFile):
    """A published file of a detector's weights.

    Attributes:
        detector: the detector that reads it, by registry name.
        licence: of the weights, as their project states it.
        note: what to do with the file, or None if it can be used as it is.
    """

    detector: str
    licence: str
    note: str | None = None


_YOLOX = "https://github.com/Megvii-BaseDetection/YOLOX/releases/download/0.1.1rc0"
_ZOO = "https://huggingface.co/onnxmodelzoo/legacy_models/resolve/ff8aa79eb107c6a2b3540abff9f8266190b799bb/validated"
_ZOO_LFS = "https://media.githubusercontent.com/media/onnx/models"
_SEGMENTATION = "vision/object_detection_segmentation"

TABLE: dict[str, PublishedWeights] = {
    "yolox_nano": PublishedWeights(
        file="yolox_nano.onnx",
        detector="yolox",
        urls=(f"{_YOLOX}/yolox_nano.onnx",),
        licence="Apache-2.0",
        size_bytes=3_659_407,
        sha256="c789161ed43c8269fcd4e67c67eeeb4e80c622da2eb296a20bc6007bd18a0b7d",
    ),
    "yolox_nano_reexport": PublishedWeights(
        file="yolox_nano_reexport.onnx",
        detector="yolox",
        urls=(
            "https://raw.githubusercontent.com/Bigisland1729/object-detection-models/"
            "6e770c5ef34fa42aaa2521eb7d0d9ec2bb5f40a3/yolox_nano.onnx",
        ),
        licence="Apache-2.0 (YOLOX; the repository itself names none)",
        size_bytes=3_678_356,
        sha256="e8af074932d4ed7e232278e3055cefcdea3edf178874a3694ae292649fb464dd",
    ),
    "yolov4": PublishedWeights(
        file="yolov4.onnx",
        detector="yolov4",
        urls=(
            f"{_ZOO}/{_SEGMENTATION}/yolov4/model/yolov4.onnx",
            f"{_ZOO_LFS}/2a67a85e670e61bf9819e9df6dae3771974552ff/validated/{_SEGMENTATION}/yolov4/model/yolov4.onnx",
        ),
        licence="MIT",
        size_bytes=257_470_589,
        sha256="1881fe9c506c970d7866cb4bfc33bda791ce46951a3c39c45ace2ff2b9daf369",
    ),
    "faster_rcnn": PublishedWeights(
        file="FasterRCNN-10.onnx",
        detector="faster_rcnn",
        urls=(
            f"{_ZOO}/{_SEGMENTATION}/faster-rcnn/model/FasterRCNN-10.onnx",
            f"{_ZOO_LFS}/8883e49e68de7b43e263d56b9ed156dfa1e03117/{_SEGMENTATION}/faster-rcnn/model/FasterRCNN-10.onnx",
        ),
        licence="MIT",
        size_bytes=167_330_019,
        sha256="dfb81423efbea52e45df242ade64cfca0ba05fae78e00cf0c68a0979987f87eb",
    ),
    "yolov7": PublishedWeights(
        file="yolov7.pt",
        detector="yolov7",
        urls=("https://github.com/WongKinYiu/yolov7/releases/download/v0.1/yolov7.pt",),
        licence="GPL-3.0",
        note=(
            "a checkpoint, not yet a network file: in a checkout of github.com/WongKinYiu/yolov7 run"
            " 'python export.py --weights yolov7.pt --grid --img-size 640 640' and give the detector yolov7.onnx"
        ),
    ),
}
"""By name."""
