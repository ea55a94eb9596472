"""Monitor the physical condition of a camera and adapt its exposure and gain to the vision task.

After Wischow, Gallego, Ernst and Boerner, "Monitoring and Adapting the Physical State of a Camera for
Autonomous Vehicles", IEEE T-ITS 2023. Floors, from the ground up: ``processor``, ``config``, ``streams``,
``store``, ``executor`` (0), ``camera`` (1), ``scenes`` (2), ``datasets`` (3), ``blur``, ``noise``, ``detection`` (4),
``curves`` and ``condition`` (5), ``control`` (6), ``report`` (7), ``stages`` and ``cli`` (8).
"""

from pipeline import processor as _processor

_processor.pin()  # before any module of this package imports NumPy, OpenCV or torch, which read the pins when loaded
