"""What a run of the bench measures, and how finely."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from glcaustics.bench.measure import Timing
from glcaustics.caustics.registry import METHODS

PARTS = {
    "caustics": "error against run time of every method and of its peers, and times at equal error",
    "photons": "photon_trace in the flooded scenes: error at the camera's pixels, its cost, its peers",
    "mesh": "the displaced mesh on peer-pool as published implementations were measured",
    "eye": "convergence and cost of eye rays and light rays over seeded views",
    "seen": "the caustic as an eye sees it through water, against Mitsuba in two stages",
}


@dataclass(frozen=True)
class FlickerPlan:
    """A pan of `frames` frames over still light by `pan_px` pixels a frame, at `size`; the last `shown` are judged.

    The error is that at `reference_views` of them (0: none), each against `reference_frames` (even) unfiltered frames
    of `reference_photons`. On two cores 14 to 22 s a scene, and the reference 9 to 13 s; quick runs take a quarter of
    the reference.
    """

    size: tuple[int, int] = (240, 200)
    photons: int = 1 << 16
    frames: int = 44
    shown: int = 12
    pan_px: float = 0.3
    reference_photons: int = 1 << 20
    reference_frames: int = 4
    reference_views: int = 4


@dataclass(frozen=True)
class PhotonPlan:
    """`side`: of the square pictures, which are filtered to `filtered`^2; `view_size`: texels a side of light views.

    `photons`: a frame; `frames`: static ones. `cells`: of the reference's light mesh. `table_size`: of the picture
    whose passes are timed, over `table_frames` frames. `peer_photons`: of Mitsuba; `validate`: of each of its halves.
    """

    scenes: tuple[str, ...] = ("flooded-cornell", "flooded-colonnade")
    side: int = 1024
    filtered: int = 256
    view_size: int = 2048
    photons: tuple[int, ...] = (500_000, 1_000_000, 2_000_000)
    frames: int = 16
    cells: int = 512
    table_size: tuple[int, int] = (1920, 1080)
    table_frames: int = 4
    peer_photons: tuple[int, ...] = (1 << 18, 1 << 20, 1 << 22, 1 << 24)
    validate: int = 1 << 23
    flicker: FlickerPlan = field(default_factory=FlickerPlan)


@dataclass(frozen=True)
class EyePlan:
    """Eye rays and light rays: `views` seeded views a scene at `size`; costs over `rounds` frames at `cost_views` of
    them; pictures at `picture_size` with `picture_samples` a pixel."""

    scenes: tuple[str, ...] = ("pool", "glass-statue", "boat", "lagoon")
    views: int = 6
    size: tuple[int, int] = (1280, 720)
    rounds: int = 5
    cost_views: int = 6
    cost_size: tuple[int, int] = (1280, 720)
    light_quality: str = "medium"
    picture_size: tuple[int, int] = (1280, 720)
    picture_quality: str = "high"
    picture_samples: int = 4


@dataclass(frozen=True)
class SeenPlan:
    """The caustic through water: `side` of the picture; `quality` steps of ours; `spp` of Mitsuba's second stage;
    `peers`: (photons, spp) of Mitsuba in both stages, growing together."""

    scene: str = "pool"
    side: int = 256
    map_side: int = 1024
    qualities: tuple[str, ...] = ("low", "medium", "high")
    spp: int = 1024
    peers: tuple[tuple[int, int], ...] = ((1 << 20, 8), (1 << 22, 32), (1 << 24, 128))


@dataclass(frozen=True)
class MeshPlan:
    """(mesh, map) a side without folds and with; `pixels` of the picture; `cells` of the reference's light mesh."""

    smooth: tuple[tuple[int, int], ...] = ((64, 256), (128, 512), (256, 1024))
    folded: tuple[tuple[int, int], ...] = ((256, 1024), (512, 1024))
    pixels: int = 1024
    cells: int = 1536


@dataclass(frozen=True)
class Plan:
    """What is measured. `sizes`: pixels a side, each a divisor of the largest; `photons`: of the peers;
    `validate`: photons of each Mitsuba half that the beams are held against, 0 = not; `seconds`: given to LuxCore;
    `parts`: of PARTS; `frames`: of a still that a noisy method gets before it is judged."""

    scenes: tuple[str, ...]
    methods: tuple[str, ...]
    qualities: tuple[str, ...]
    sizes: tuple[int, ...]
    photons: tuple[int, ...]
    validate: int
    cells: int
    scaling_scene: str | None
    timing: Timing = field(default_factory=Timing)
    backend: str = "auto"
    quick: bool = False
    seconds: tuple[float, ...] = (1.0, 4.0, 16.0)
    parts: tuple[str, ...] = tuple(PARTS)
    frames: int = 16
    photon: PhotonPlan = field(default_factory=PhotonPlan)
    eye: EyePlan = field(default_factory=EyePlan)
    seen: SeenPlan = field(default_factory=SeenPlan)
    mesh: MeshPlan = field(default_factory=MeshPlan)

    @property
    def largest(self) -> int:
        return max(self.sizes)


FULL = Plan(
    ("pool", "peer-pool", "glass-sphere", "glass-bunny", "metal-ring"),
    tuple(METHODS),
    ("draft", "low", "medium", "high"),
    (256, 512),
    (1 << 16, 1 << 18, 1 << 20, 1 << 22, 1 << 24),
    1 << 23,
    1024,
    "peer-pool",
)
QUICK = replace(
    FULL,
    scenes=("pool", "peer-pool", "glass-sphere", "metal-ring"),
    qualities=("draft", "medium"),
    sizes=(128,),
    photons=(1 << 15, 1 << 17, 1 << 19),
    validate=1 << 19,
    cells=320,
    timing=Timing(3, 30, 0.3),
    quick=True,
    seconds=(1.0, 4.0),
    frames=4,
    photon=PhotonPlan(
        scenes=("flooded-cornell",),
        side=256,
        view_size=768,
        photons=(1 << 19,),
        cells=160,
        table_size=(640, 360),
        table_frames=2,
        peer_photons=(1 << 17, 1 << 19, 1 << 21),
        validate=1 << 20,
        flicker=FlickerPlan(reference_frames=2, reference_views=2),
    ),
    mesh=MeshPlan(cells=384),
    eye=EyePlan(
        views=2,
        size=(320, 180),
        rounds=2,
        cost_views=1,
        cost_size=(320, 180),
        light_quality="low",
        picture_size=(640, 360),
        picture_quality="medium",
        picture_samples=1,
    ),
    seen=SeenPlan(side=96, map_side=512, qualities=("low", "medium"), spp=256, peers=((1 << 18, 8), (1 << 20, 32))),
)
