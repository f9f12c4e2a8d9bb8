"""What is compared: ours, the paper's way, and ours without one ingredient each."""

from dataclasses import dataclass
from typing import Literal

from storage.candidates import FEATURES, FIG_10, SHARES
from tasks.doors.candidates import CandidateParams
from tasks.doors.openings import PAPER, OpeningsParams
from tasks.doors.templates import TemplateParams
from tasks.doors.topology import TopologyParams

BOUNDLESS = 1e9
OUR_WAY, LINES_AND_TEMPLATES = OpeningsParams(), CandidateParams()
NO_TEMPLATES = CandidateParams(templates=TemplateParams(step_m=BOUNDLESS))
OF_THE_PAPER = (*FIG_10, *SHARES)
"""The features the paper's classifier knows: Fig. 10's eight and three shares of areas."""


@dataclass(frozen=True)
class Variant:
    """One way from images to doors."""

    name: str
    about: str
    openings: OpeningsParams = OUR_WAY
    candidates: CandidateParams = LINES_AND_TEMPLATES
    features: tuple[str, ...] = FEATURES
    """what its classifier knows"""
    classifier: Literal["forest", "svm"] = "forest"


OURS = Variant("ours", "all of ours")
THE_PAPER = Variant(
    "paper", "Fig. 10 and shares, winner per wall", PAPER, NO_TEMPLATES, OF_THE_PAPER
)
VARIANTS = (
    OURS,
    THE_PAPER,
    Variant("no-path", "no trajectory", OpeningsParams(crossing_weight=0.0)),
    Variant("no-both", "each face of a wall for itself", OpeningsParams(faces="each")),
    Variant(
        "no-only-door",
        "rooms may be without a door",
        OpeningsParams(topology=TopologyParams(only_door_p=1.0)),
    ),
    Variant("no-templates", "rectangles of lines only", candidates=NO_TEMPLATES),
    Variant("wall-winner", "one door per wall face", OpeningsParams(winner="wall", faces="each")),
    Variant("fig-10", "Fig. 10 and shares only, ours else", features=OF_THE_PAPER),
    Variant("svm", "SVM, ours else", classifier="svm"),
)
