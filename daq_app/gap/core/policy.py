"""Every threshold that decides in a diagnosis: quantity, unit, source, consequence.

Nothing in the core decides by a number from elsewhere. Search widths and tolerances, which cost time and not
answers, stand where they are used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.special import expit


@dataclass(frozen=True, slots=True)
class Policy:
    """The thresholds of one diagnosis."""

    # Findings about instruments
    finding_in_noise: float = 1.0
    """Rms of a pick-up, or reading step, over the rms noise of one reading, from which it is material.
    Below it averaging over a half-cycle leaves nothing (assumed); raising it hides loud pick-up."""

    finding_noise: float = 3.0
    """Noise of a channel over that of its family from which it is material: those of ordinary laboratories
    differ by up to two (assumed); raising it hides loud channels."""

    finding_shaking: float = 0.09
    """Acceleration of a burst of the floor, m/s², from which it is material: a hundredth of g turns a wall by
    less than its impacts scatter, and shaken cables show 0.07 in development laboratories; raising it hides
    weak traffic."""

    finding_floor: float = 0.03
    """Amplitude of an irregular acceleration of the floor, m/s², √2 times its rms, from which it is material:
    halves of the accelerometers share 0.007 at most on quiet floors, and 0.1 moves times and peaks by several
    of their errors; raising it hides weak floors."""

    finding_ringing: float = 0.3
    """Size of a single channel's ring after the fastest impact over the rms noise of one reading, from which
    it is material: walls that ring leave 0.14 of it in one channel in development laboratories; raising it
    hides loose brackets."""

    finding_crossed: float = 0.1
    """Share of the rotation across an instrument's axis from which it is material: a mount that is turned by
    6°, three sd of what a rough laboratory has (assumed); raising it hides crosstalk."""

    finding_unlike: float = 0.1
    """Share of the acceleration that a tiltmeter feels, or of what it shows that is no rotation, from which
    it is material: three times what is looked at, ten times what sound ones have in development laboratories;
    raising it hides tiltmeters that are no measure of rotation."""

    finding_slip: float = 2e-4
    """Slip of a base between two impacts, m, or turn, rad, from which it is material: where it stops, at the
    next impact, a slip of 0.2 mm in 0.3 s takes as much of the speed as r scatters by; raising it hides slips
    that change r."""

    # The model's own discrepancy
    usual_discrepancy: float = 1.0
    """Scale of the half-Cauchy prior of a group's discrepancy, in nominal sd (Gelman, Bayesian Analysis 1,
    2006). Raising it lets every group misfit for less, so that weak effects are lost sooner."""
    starting_discrepancy: float = 0.2
    """Discrepancy, in nominal sd, from which its estimate starts; it decides between two optima only."""
    ordered_sd: float = 3.0
    """Correlation of residuals with the next ones, in standard errors, from which they are no scatter: one
    group of independent residuals in 370 has it. Raising it takes another law for scatter."""

    expected_scatter_sd: float = 2.0
    """Prior sd, in the logarithm, up to which a scatter may be in order: where r remembers earlier impacts it
    is four. Raising it takes larger laws for scatter."""

    # Hypotheses
    prior_null: float = 0.2
    """Prior probability that nothing is missing (design targets: 10 to 20 % of cases)."""
    prior_count: tuple[float, ...] = (0.85, 0.13, 0.02)
    """Prior probability of one, two and three causes where there are any. A fourth is not looked for."""
    prior_other_form: float = 0.15
    """Odds of any other form of a law against the library's: of five causes one is in no library, and of
    these about half are another form of a law that is (design). Raising it says "cannot tell" of effects
    that are too weak to show their form."""
    further_nats: float = 5.0
    """What a further cause, or a first one beside a material finding, costs in log evidence beyond its prior:
    what the form of the others leaves, it takes up. True ones that are larger than their form may be wrong by
    gain 6 or more in development laboratories, false ones 7 at most where nothing else is missing. Raising it
    loses weak causes beside strong ones."""
    further_share: float = 0.03
    """Amplitude of what a further cause takes away, over that of what the others explain in the same groups
    of features, from which it is more than their form may be wrong by. True ones begin at 0.06 in development
    laboratories, and at less for a real drive, whose third cause is lost at 0.05. Raising it loses weak
    causes beside strong ones."""
    improved_nats: float = 0.5
    """What a cause must take off the misfit of a group of features to improve it, and gain over nothing
    missing to be called below detection: half a nat is what one more coefficient gains by chance. Raising it
    compares a cause with less, and passes over weak ones."""
    unforeseen: float = 0.05
    """Probability that an answer is wrong although nothing says so: a further cause too weak to show, a form
    so near one of the library that it leaves nothing. Without it three answers of 62 development cases were
    sure and wrong, and five of 120 of left-out laboratories (page of scores). Raising it makes no answer
    sure."""
    name_probability: float = 0.90
    """Probability from which an answer is named alone; raising it says "cannot tell" more often."""
    set_content: float = 0.95
    """Probability that the set of answers holds."""
    detected_sd: float = 4.0
    """Posterior sd below which a cause is below detection (design: effects from 4 sd on must be found)."""
    usual_sd: float = 2.0
    """Posterior sd from none from which the answer says of what any specimen has that these runs show it
    (one in twenty by chance); raising it says less."""
    null_probability: float = 0.5
    """Probability of "nothing missing" from which it is the answer although weak causes are not excluded;
    below, the likeliest of them is said to be below detection."""
    null_excluded: float = 1e-3
    """Probability of "nothing missing" below which a weak cause is there all the same."""

    # What remains
    unknown_share: float = 0.3
    """Share of the gap, in nats, at which what remains is as likely something unknown as not. In the
    project's own worlds known causes leave 0.01 at most, unknown ones 0.6 or more."""
    unknown_nats: float = 20.0
    """Nats of discrepancy beyond the usual at which what remains matters as likely as not. In own worlds
    known causes leave 1 at most, unknown ones 29 or more; ordinary laboratories leave some."""
    unknown_misfit: float = 25.0
    """Discrepancy of one group, in nominal sd, that is as likely something unknown as the model's own. In
    development laboratories known causes leave 11 at most, unknown ones of that kind 45 or more; raising it
    hides what a strong cause outshines."""
    unknown_steepness: float = 4.0
    """Slope of the logistic in the logarithm of each; raising it makes the gate a step."""
    lone_instruments: int = 2
    """Single instruments that may be off at once, each by a fault of its own (assumed)."""
    common_cause: float = 0.95
    """Probability that more of them have a cause in common, which no effect of the library is. One hypothesis
    in fifty has three causes, and of these one in a hundred has each in an instrument of its own (assumed);
    lowering it names crosstalk between three channels as three gains."""
    form_nats: float = 4.5
    """Gain of a free form on top of the best hypothesis beyond one nat per coefficient, in log posterior,
    that is as likely another form as not ..."""
    form_share: float = 0.02
    """... or this share of what is explained, whichever is more; no effect's model is better. In development
    laboratories a form gains 3.8 at most on right answers, and 6 or more where it shows another law; on the
    right answer for a real drive it gains 0.01 to 0.02 of what that explains. Raising either names a law that
    is only near."""
    own_form: float = 0.05
    """Departure from its own form, as a share of another form's, that our model of an effect may have."""
    listed: float = 0.05
    """Probability from which a cause is listed at all."""
    refused: float = 0.5
    """Probability of something unknown from which the answer is "none of these"."""
    parameters_gap: float = 1.3
    """Gap at nominal parameters, over noise and scatter, from which the answer is "parameters"."""
    within_noise: float = 1.5
    """Rms of what a cell of the map leaves, over noise and scatter, below which the map says that nothing is
    beyond noise (assumed); raising it passes over weak gaps."""
    loud_share: float = 0.3
    """Share of the largest cell of the map from which a channel is named beside it (assumed)."""
    cause_closes: float = 0.02
    """Share of the held-out gap below which a cause is listed and is not spoken of as material (assumed)."""

    def chance(self, size: float, limit: float) -> float:
        """Probability, 1, that a size matters that is as likely to matter as not at a limit."""
        if size <= 0.0:
            return 0.0
        distance = math.log(size / limit) if limit > 0.0 else math.inf
        return float(expit(self.unknown_steepness * distance))


POLICY = Policy()
