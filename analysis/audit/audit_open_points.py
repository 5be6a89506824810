"""Where the paper contradicts itself or leaves open what is needed to do it again, and what is done here."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OpenPoint:
    """A contradiction, or something left open.

    Attributes
    ----------
    places : str
        Where it stands in the paper.
    printed : str
        What is printed, or not.
    here : str
        What this software does.
    page : str
        The page of docs/decisions/ that gives the reasons.
    """

    places: str
    printed: str
    here: str
    page: str


CONTRADICTIONS = (
    OpenPoint(
        "Table 2 and Section 4; caption of Figure 12",
        "The library's target is 0.5 in the table and in the list 30, 40, 50, 70 %, and 0.6 in the caption.",
        "0.5: so say two places, and Table 3 lies nearer to it.",
        "sequence-names-and-targets.md",
    ),
    OpenPoint(
        "Section 4; Equation 6; caption of Figure 12",
        "A target is an average brightness factor, a power in watts, or a fraction of the screen's power.",
        "The unit of a budget is always named; the default is the mean factor.",
        "budget.md",
    ),
    OpenPoint(
        "Section 4; Sections 4.1 and 4.2; Tables 1 to 3",
        "The second sequence is school in the text and gym in the tables; a house occurs in 4.2 and 6.",
        "School and house are environments, gym is a path through the school.",
        "sequence-names-and-targets.md",
    ),
    OpenPoint(
        "Section 3.4",
        "The calibration is called a two-alternative forced choice; one ramp is answered yes or no.",
        "Yes/no with catch trials, or a true choice between two intervals; files say which.",
        "yes-no-task.md",
    ),
    OpenPoint(
        "Section 3.3, Equation 6",
        "The limit on the rate is an equation, which makes every frame change at the largest rate.",
        "An upper limit, step by step.",
        "rate-constraint.md",
    ),
    OpenPoint(
        "Equation 6; Sections 3.4 and 3.5",
        "Factors lie below 1 in the equation; 1.0 is calibrated, precomputed and compared with.",
        "0.2 to 1, both included.",
        "factor-range.md",
    ),
    OpenPoint(
        "Equation 6",
        "Frames are counted to N in the objective and to n in the limit; nothing else is called n.",
        "One number of frames, N - 1 steps.",
        "rate-constraint.md",
    ),
    OpenPoint(
        "Equations 2 and 6",
        "L_a is the luminance around a point in one and the average luminance of a frame in the other.",
        "Two quantities with two names: adaptation luminance, mean luminance.",
        "rate-constraint.md",
    ),
    OpenPoint(
        "Equations 3 and 4",
        "Contrast carries a sign, and counts above 1 only: detail darker than its surroundings never would.",
        "Both polarities count.",
        "visibility.md",
    ),
    OpenPoint(
        "Table 2, its caption, and Section 4.4",
        "An average in the caption, integrated over time in the text; 1.4984 is more than two responses "
        "from 0 to 1 can differ by, and no unit or time step is printed.",
        "Time average [1] and integral [s], per pixel and of the frame mean, beside constant dimming's.",
        "visual-adaptation.md",
    ),
    OpenPoint(
        "Equation 7, Table 3; Section 4",
        "Power is that of an LCD panel of at least 750 cd/m²; people saw a headset of 104 cd/m².",
        "The power panel has a peak luminance of its own.",
        "power.md",
    ),
    OpenPoint(
        "Caption of Table 1 and its last column",
        "A probability of detecting, with 0.5 for nobody can tell; the numbers are percentages of choices.",
        "Shares of choices with intervals, and an equivalence test against a margin that is stated.",
        "comparison-inference.md",
    ),
    OpenPoint(
        "Sections 3.2 and 6",
        "Contrast is lost against the undimmed frame in one, against the previous frame in the other.",
        "Against the undimmed frame, online too.",
        "online-controller.md",
    ),
)

LEFT_OPEN = (
    OpenPoint(
        "Table 1",
        'Which standard deviation the SEM rests on; any test, effect size or interval for "consistently '
        'outperformed".',
        "The sample's, and the population's beside it; exact paired tests with Holm, effects with intervals.",
        "rating-inference.md",
    ),
    OpenPoint(
        "Section 4.2, Figure 7",
        'Which test "significantly" refers to; what averages do with rings that were not found; the numbers.',
        "Undetected rings are censored times; detection is tested by itself.",
        "search-inference.md",
    ),
    OpenPoint(
        "Section 3.4, Figure 3",
        "The thresholds (eight, in the authors' program; the text has five factors on two screens), whether "
        "answers were pooled, and of what the polynomial is.",
        "The eight are a preset; participants first, then a mixed model; ln(rate) over luminance.",
        "fourth-degree-fit.md",
    ),
    OpenPoint(
        "Section 3.4",
        "The limit outside the luminances that were measured, where dark scenes lie.",
        "A constant relative rate below, held above.",
        "rate-limit-outside-its-range.md",
    ),
    OpenPoint(
        "Equations 1, 2 and 4",
        "How colour becomes luminance, the frequency of a band, how many bands count, 0/0 in the loss.",
        "Named choices, each with a page.",
        "bands.md",
    ),
    OpenPoint(
        "Section 4.1",
        'Orders beyond "randomized", how long people adapted, repetitions.',
        "Orders counterbalanced and recorded with every trial.",
        "viewing-orders.md",
    ),
    OpenPoint(
        "Section 6, Figure 9",
        "The time step of the controller, without which its integral and derivative gains have no unit.",
        "Gains per frame of 1/90 s, scaled to the frames there are, so that the frame rate changes nothing; "
        "per second and per frame of the video are a setting.",
        "online-controller.md",
    ),
    OpenPoint(
        "Caption of Figure 10",
        "Over how many frames the two standard deviations are, and how far they are known: successive frames "
        "are alike.",
        "An interval of their ratio that allows for that.",
        "online-controller.md",
    ),
)
