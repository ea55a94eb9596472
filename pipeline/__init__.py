"""Monitor the physical condition of a camera and adapt its exposure and gain to the vision task.

After Wischow, Gallego, Ernst and Boerner, "Monitoring and Adapting the Physical State of a Camera for
Autonomous Vehicles", IEEE T-ITS 2023. Floors, from the ground up, each of which knows those below only: single
modules such as ``streams``, ``store`` and ``executor`` (0), ``camera`` (1), ``scenes`` (2), ``datasets`` and
``learning`` (3), ``blur``, ``noise`` and ``detection`` (4), ``condition`` (5), ``experiments`` (6), ``curves`` (7),
``control`` (8), ``report`` (9), ``config`` and ``recording`` (10), ``stages``, ``cli`` and ``dvc`` (11).
"""

from pipeline import processor as _processor

_processor.pin()  # before any module of this package imports NumPy, OpenCV or torch, which read the pins when loaded
