//! Findings in plain English.

use std::fmt::{self, Display, Formatter};

use mechid_model::ResponseQuantity;
use mechid_signal::message;

use super::finding::{
    Channel, Concentration, CorrelationTest, Finding, ModeLimit, NoiseSource, NoiseSpan, PValue,
    PeriodFault, Power, Quantity, Reference, Residual,
};
use super::{Subject, Verdict};

impl Finding {
    /// Returns the finding as a sentence in which `name` says what the channels are called.
    pub fn sentence<'a>(&'a self, name: &'a dyn Fn(Channel) -> String) -> impl Display + 'a {
        Sentence { finding: self, name }
    }
}

impl Display for Finding {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.sentence(&|channel| channel.to_string()).fmt(f)
    }
}

/// A finding whose channels have names.
struct Sentence<'a> {
    finding: &'a Finding,
    name: &'a dyn Fn(Channel) -> String,
}

impl Sentence<'_> {
    fn force(&self, index: usize) -> String {
        (self.name)(Channel { quantity: Quantity::Force, index })
    }

    fn response(&self, kind: ResponseQuantity, index: usize) -> String {
        (self.name)(Channel { quantity: Quantity::Response(kind), index })
    }
}

impl Display for Sentence<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.finding {
            Finding::PersistentExcitation { force, order, needed } => {
                persistent_excitation(f, &self.force(*force), *order, *needed)
            }
            Finding::ExcitedLines { lines, unknowns } => {
                write!(
                    f,
                    "{} with force: {} for {} in each equation of motion",
                    message::count(*lines, "line"),
                    message::count(2 * lines, "equation"),
                    message::count(*unknowns, "unknown")
                )?;
                f.write_str(match self.finding.verdict() {
                    Verdict::Good => "",
                    Verdict::Doubtful => "; no redundancy to estimate the noise",
                    Verdict::Bad => "; excite more lines",
                })
            }
            Finding::Conditioning { condition_number, undetermined } => {
                conditioning(f, *condition_number, *undetermined, self.finding.verdict())
            }
            Finding::Seam { ratio } => {
                write!(
                    f,
                    "from the last sample back to the first the response bends {ratio:.1} times as \
                     much as elsewhere: "
                )?;
                f.write_str(match self.finding.verdict() {
                    Verdict::Good => "consistent with a whole period",
                    Verdict::Doubtful => "hardly a steady state over one whole period",
                    Verdict::Bad => "not a whole period; fit it as an open record",
                })
            }
            Finding::PeriodScatter { fraction } => {
                write!(
                    f,
                    "single periods of the response differ from their mean by up to {:.2} %",
                    100.0 * fraction
                )?;
                f.write_str(match self.finding.verdict() {
                    Verdict::Good => "",
                    Verdict::Doubtful => {
                        ": noise, drift, or a transient that has not decayed; leave out the beginning, or \
                         average more periods"
                    }
                    Verdict::Bad => ": hardly a steady response of this period; check `period`",
                })
            }
            Finding::UnequalPeriods { fraction } => write!(
                f,
                "single periods of the force differ from their mean by up to {:.2} %, and the response \
                 follows them: the test does not repeat, and what differs is no noise. Average frequency \
                 responses over the periods (`from_frf`), or fit the strokes of a hammer as `hits`",
                100.0 * fraction
            ),
            Finding::WrongPeriod { claimed, fault } => fault.sentence(*claimed, f),
            Finding::HighestMode { frequency_hz, samples_per_period, limit } => {
                let condition = match limit {
                    ModeLimit::Euler { .. } => " if the force is held between the samples",
                    _ => "",
                };
                write!(
                    f,
                    "the highest mode ({frequency_hz:.4} Hz{condition}) has {samples_per_period:.1} samples per \
                     period{}",
                    limit.clause(self.finding.verdict(), *samples_per_period)
                )
            }
            Finding::NoLogarithm { eigenvalue } => write!(
                f,
                "the transition from sample to sample has the eigenvalue {eigenvalue:.3e}, zero or \
                 negative: the sampling interval is too long for a mode, or the data hold mostly noise; \
                 sample faster"
            ),
            Finding::Coherence { median, minimum, averages } => {
                write!(
                    f,
                    "median coherence {median:.4}, minimum {minimum:.4}, from {averages:.1} \
                     independent averages"
                )?;
                f.write_str(match self.finding.verdict() {
                    Verdict::Good => "",
                    _ => ": noise, leakage, or other forces; use longer segments, or more of them",
                })
            }
            Finding::Leakage { mode, frequency_hz, lines, samples_needed, settled } => {
                write!(
                    f,
                    "the resonance of mode {} ({frequency_hz:.4} Hz) is {} lines of a segment wide",
                    mode + 1,
                    three_digits(*lines)
                )?;
                match (self.finding.verdict(), settled) {
                    (Verdict::Good, _) => Ok(()),
                    (_, true) => write!(
                        f,
                        ": its damping follows from leakage, and the intervals are not reliable; use segments of \
                         {samples_needed} samples or more, or fit the record with the loads of its ends (without \
                         `from_frf`)"
                    ),
                    (_, false) => write!(
                        f,
                        ", and what the window blunts could not be told from it: the intervals are not reliable; \
                         use segments of {samples_needed} samples or more, or fit the record with the loads of \
                         its ends (without `from_frf`)"
                    ),
                }
            }
            Finding::Clipping { channel, level, samples } => write!(
                f,
                "{channel} is clipped at {}: {} at that level, three or more in a row; choose a wider \
                 range of the amplifier or converter and measure again",
                six_digits(*level),
                message::count(*samples, "sample"),
                channel = (self.name)(*channel)
            ),
            Finding::ConstantChannel { channel, level, samples } => write!(
                f,
                "{channel} is {} in all {samples} samples: no response there, or a dead channel; check the sensor",
                message::number(*level),
                channel = (self.name)(*channel)
            ),
            Finding::Quantisation { channel, levels, step } => write!(
                f,
                "{channel} has {levels} values only, {} apart: the range of the converter is far too \
                 wide, or its bits are too few; choose a narrower range and measure again",
                six_digits(*step),
                channel = (self.name)(*channel)
            ),
            Finding::Spike { channel, sample, ratio } => write!(
                f,
                "sample {} of {channel} is a spike, {} times as sharp as any other: an error of the \
                 transmission; leave it out of the window",
                sample + 1,
                six_digits(*ratio),
                channel = (self.name)(*channel)
            ),
            Finding::Kinematics { dof, quantity, derivative, gain } => write!(
                f,
                "{} changes {} times as much as {} predicts: their units, columns or signs are inconsistent",
                self.response(*quantity, *dof),
                six_digits(*gain),
                self.response(*derivative, *dof)
            ),
            Finding::PowerFlow { fraction } => write!(
                f,
                "the forces take power out of the machine ({:.1} % of the apparent power): force and \
                 response are interchanged, one of them has the wrong sign or a delay, or something \
                 else drives the machine",
                -100.0 * fraction
            ),
            Finding::Delay { samples, seconds, remaining } => {
                delay(f, *samples, *seconds, *remaining)
            }
            Finding::Bias { p_value, parameter, estimate, unbiased, standard_error, reference } => {
                let [value, other] = [six_digits(*estimate), six_digits(*unbiased)];
                let errors = (unbiased - estimate).abs() / standard_error;
                if self.finding.verdict() == Verdict::Good {
                    write!(
                        f,
                        "the estimate agrees with {reference} ({p_value}): {parameter} is {other} \
                         there, {value} here, {errors:.1} standard errors away"
                    )
                } else {
                    write!(
                        f,
                        "noise on the response biases the estimate ({p_value}): by {reference} \
                         {parameter} is {other} instead of {value}, {errors:.1} standard errors away; \
                         prefer maximum likelihood on whole periods"
                    )
                }
            }
            Finding::Instability { mode, frequency_hz, growth_rate, standard_error, p_value } => {
                let number = mode + 1;
                let growth = [*growth_rate, *standard_error].map(three_digits).join(" ± ");
                let frequency = three_digits(*frequency_hz);
                if self.finding.verdict() == Verdict::Good {
                    write!(
                        f,
                        "mode {number} ({frequency} Hz) of the estimate grows at {growth} 1/s, no more \
                         than the noise explains ({p_value}); its free response cannot be predicted"
                    )
                } else {
                    let doubling = three_digits(std::f64::consts::LN_2 / growth_rate);
                    write!(
                        f,
                        "mode {number} ({frequency} Hz) is unstable ({p_value}): its free response grows \
                         at {growth} 1/s and doubles every {doubling} s. Possible causes: a machine that \
                         feeds its own vibration (oil film, control), a channel of the wrong sign or with \
                         a delay"
                    )
                }
            }
            Finding::MassSymmetry { row, column, above, below, standard_error, p_value } => {
                let (i, j) = (row + 1, column + 1);
                let errors = three_digits((above - below).abs() / standard_error);
                let [above, below] = [*above, *below].map(three_digits);
                if self.finding.verdict() == Verdict::Good {
                    write!(
                        f,
                        "M is symmetric as far as the noise shows: m{i}{j} and m{j}{i} differ by {errors} \
                         standard errors ({p_value})"
                    )
                } else {
                    write!(
                        f,
                        "M is not symmetric, which the kinetic energy of a machine makes it: m{i}{j} is {above} kg \
                         and m{j}{i} {below} kg, {errors} standard errors apart ({p_value}). Possible causes: \
                         crosstalk between forces or between responses, a gain that is wrong, a sensor that is not \
                         at the point and in the direction of its force"
                    )
                }
            }
            Finding::NegativeMass { row, mass, standard_error, p_value } => {
                let (i, errors) = (row + 1, three_digits(mass.abs() / standard_error));
                let mass = three_digits(*mass);
                if self.finding.verdict() == Verdict::Good {
                    write!(
                        f,
                        "m{i}{i} is {mass} kg, negative by no more than noise makes it: {errors} standard errors \
                         ({p_value})"
                    )
                } else {
                    write!(
                        f,
                        "m{i}{i} is {mass} kg, {errors} standard errors below zero ({p_value}): no machine has a \
                         negative mass. Possible causes: a force or a response of the wrong sign, channels in the \
                         wrong order, a quantity taken for another one (acceleration for displacement)"
                    )
                }
            }
            Finding::Gain { row, column, ratio, .. } => {
                let (i, j, ratio) = (row + 1, column + 1, three_digits(*ratio));
                write!(
                    f,
                    "C and K are symmetric but for one factor: c{i}{j} over c{j}{i} and k{i}{j} over k{j}{i} are both \
                     {ratio}, as where response {i} or force {i} is read {ratio} times too large beside number {j}: \
                     look at their units and gains"
                )
            }
            Finding::UnmeasuredForce { fraction } => {
                let percent = three_digits(100.0 * fraction);
                write!(
                    f,
                    "{percent} % of the motion is taken for the response to forces that were not measured"
                )?;
                f.write_str(match self.finding.verdict() {
                    Verdict::Good => "",
                    _ => {
                        ": a nonlinearity under a random force looks like that, and so does a degree of freedom that \
                         is missing; repeat the test at another level of the force, or with periods that repeat"
                    }
                })
            }
            Finding::Misfit { ratio, p_value, source, concentration } => misfit(
                f,
                *ratio,
                p_value,
                *source,
                (self.finding.verdict(), concentration.as_ref()),
            ),
            Finding::Unit { column, text, factor, used, si } => {
                unit(f, column, text, (*factor, *used), si)
            }
            Finding::TimeUnit { column, rate_hz, duration_s, unit, factor } => write!(
                f,
                "the time in column {column} has no unit and is taken as seconds: {} Hz, {} s long; in {unit} it would be \
                 {} Hz: state the unit (`unit`) or `sample_rate`",
                up_to_six_digits(*rate_hz),
                up_to_six_digits(*duration_s),
                up_to_six_digits(rate_hz / factor),
            ),
            Finding::Linearity { power, dof, p_value } => {
                let displacement = self.response(ResponseQuantity::Displacement, *dof);
                linearity(f, *power, &displacement, p_value, self.finding.verdict())
            }
            Finding::Distortion { term, explained, even_db, odd_db, p_value } => {
                write!(
                    f,
                    "{term} explains {:.1} % of the power that a linear model leaves ({p_value})",
                    100.0 * explained
                )?;
                for (name, level) in [("even", even_db), ("odd", odd_db)] {
                    if let Some(level) = level {
                        write!(f, "; {name} distortion {level:.0} dB against the response")?;
                    }
                }
                f.write_str(
                    ": the machine is nonlinear at this level of the force, to which its parameters belong; fit \
                     the term, too (`nonlinear`), or test at a lower level",
                )
            }
            Finding::Whiteness { residual, test, span } => {
                whiteness(f, residual, test, span.as_ref(), &|force| self.force(force))
            }
            Finding::CrossCorrelation { residual, force, test } => {
                write!(f, "residual {} with {}: {test}", residual + 1, self.force(*force))?;
                f.write_str(match (test.rounding, test.is_significant()) {
                    (true, _) => "",
                    (_, false) => "; uncorrelated",
                    (_, true) => {
                        "; the residual is correlated with the force: the model misses part of the \
                         response; try another degree of freedom, or another level of the force"
                    }
                })
            }
        }
    }
}

fn persistent_excitation(
    f: &mut Formatter<'_>,
    force: &str,
    order: usize,
    needed: usize,
) -> fmt::Result {
    match order {
        0 => write!(f, "{force} is zero: it is left out, and determines no mass"),
        _ => {
            let more = if order < needed { "; excite more lines" } else { "" };
            write!(f, "{force} is persistently exciting of order {order}, {needed} needed{more}")
        }
    }
}

fn conditioning(
    f: &mut Formatter<'_>,
    condition_number: f64,
    undetermined: usize,
    verdict: Verdict,
) -> fmt::Result {
    if undetermined > 0 {
        let does = if undetermined == 1 { "does" } else { "do" };
        let combinations = message::count(undetermined, "combination");
        return write!(
            f,
            "{combinations} of displacements, velocities and forces {does} not vary in the data: some \
             parameters stay undetermined; excite more lines, or give a known mass"
        );
    }
    match condition_number {
        short if short < 1e4 => write!(f, "condition number of the regressors {short:.1}")?,
        long => write!(f, "condition number of the regressors {long:.1e}")?,
    }
    f.write_str(match verdict {
        Verdict::Good => "",
        _ => ": relative noise is amplified up to that much in the worst combination of parameters",
    })
}

impl PeriodFault {
    fn sentence(&self, claimed: usize, f: &mut Formatter<'_>) -> fmt::Result {
        let percent = |share: f64| format!("{:.2} %", 100.0 * share);
        match *self {
            PeriodFault::Neighbour { period, mismatch, claimed_mismatch } => write!(
                f,
                "the period is {period} samples: from one to the next the force differs by {} of its \
                 RMS, after {claimed} samples by {}",
                percent(mismatch),
                percent(claimed_mismatch)
            ),
            PeriodFault::Interruption { sample, mismatch } => write!(
                f,
                "the force repeats every {claimed} samples, to {} of its RMS, but not across sample {} \
                 of the window, as if samples were missing there or too many: keep to one side of it",
                percent(mismatch),
                sample + 1
            ),
            PeriodFault::Other { period, mismatch, samples } => {
                let mismatch = percent(mismatch);
                match samples.checked_sub(period) {
                    Some(compared) if compared < period => write!(
                        f,
                        "the first {compared} of {samples} samples of the force repeat {period} samples \
                         later, to {mismatch} of its RMS"
                    )?,
                    _ => write!(
                        f,
                        "the force repeats every {period} samples, to {mismatch} of its RMS"
                    )?,
                }
                write!(
                    f,
                    ", and {claimed} samples are no whole number of such periods: the lines used are \
                     not those of the force"
                )
            }
        }
    }
}

impl ModeLimit {
    fn clause(&self, verdict: Verdict, samples_per_period: f64) -> String {
        match (self, verdict) {
            (ModeLimit::AtSamples, Verdict::Good) => {
                "; the equation of motion holds at each sample".into()
            }
            (ModeLimit::BetweenSamples, Verdict::Good) => String::new(),
            (ModeLimit::BetweenSamples, Verdict::Doubtful) => {
                ", so few that the force between samples matters: sample faster, or say what it does".into()
            }
            (ModeLimit::AtSamples | ModeLimit::BetweenSamples, _) => {
                ", so few that it may be the alias of a mode above the Nyquist frequency: sample faster"
                    .into()
            }
            (ModeLimit::Euler { bias }, _) => {
                format!("; the bias of Euler's rule is about {:.1} %", 100.0 * bias)
            }
            (ModeLimit::Lines { .. }, Verdict::Good) => " and lies within the fitted band".into(),
            (ModeLimit::Lines { .. }, _) if samples_per_period <= 2.0 => {
                " and lies above the Nyquist frequency: sample faster".into()
            }
            (ModeLimit::Lines { last_hz }, _) => {
                format!(" and lies above the fitted band, which ends at {last_hz:.4} Hz")
            }
        }
    }
}

fn delay(f: &mut Formatter<'_>, samples: f64, seconds: f64, remaining: f64) -> fmt::Result {
    let (direction, size) = if samples > 0.0 { ("late", samples) } else { ("early", -samples) };
    let seconds = seconds.abs();
    let size = if size.fract() == 0.0 { format!("{size}") } else { format!("{size:.2}") };
    let percent = 100.0 * remaining;
    let percent = if percent < 0.01 { "less than 0.01".into() } else { format!("{percent:.2}") };
    write!(
        f,
        "the response is {size} samples ({seconds:.3e} s) {direction}: without that delay {percent} % \
         of the residual power remains. Possible causes: a filter, a scanning converter, a trigger; \
         shift one of the channels"
    )
}

fn misfit(
    f: &mut Formatter<'_>,
    ratio: f64,
    p_value: &PValue,
    source: NoiseSource,
    (verdict, concentration): (Verdict, Option<&Concentration>),
) -> fmt::Result {
    let times = if ratio < 1e4 { format!("{ratio:.3}") } else { format!("{ratio:.1e}") };
    write!(f, "residual power is {times} × the noise power {source} ({p_value}): ")?;
    if let (Some(few), true) = (concentration, verdict > Verdict::Good && ratio > 1.0) {
        let hz: Vec<String> = few.frequencies_hz.iter().map(|hz| line_hz(*hz)).collect();
        let hold = if hz.len() == 1 { "holds" } else { "hold" };
        let share = (100.0 * few.share).floor();
        return write!(
            f,
            "{} Hz {hold} {share} % of the misfit: run-out, mains or another disturbance? Leave out \
             with `without_hz` {}",
            listed(&hz),
            hz.join(",")
        );
    }
    f.write_str(match verdict {
        Verdict::Good => "consistent with noise",
        _ if ratio < 1.0 && source == NoiseSource::Force => {
            "the noise of the force is less than was taken, which biases the estimate; state it with \
             `force_noise`"
        }
        _ if ratio < 1.0 => {
            "the periods differ by more than noise (hits of unequal strength, a drift, a transient), and \
             the standard errors are too large; average frequency responses instead"
        }
        _ => {
            "exceeds the noise: wrong model (nonlinearity, missing degree of freedom, wrong known mass), \
             spectral leakage, or a biased estimate; do not rely on the intervals"
        }
    })
}

fn linearity(
    f: &mut Formatter<'_>,
    power: Power,
    displacement: &str,
    p_value: &PValue,
    verdict: Verdict,
) -> fmt::Result {
    match verdict {
        Verdict::Good => write!(
            f,
            "the residual is uncorrelated with the square and the cube of the displacement and with the cube \
             and the sign of the velocity as forces ({p_value})"
        ),
        _ => write!(
            f,
            "the residual is correlated with the {power} {displacement} as a force ({p_value}): \
             the machine is nonlinear at this level of the force, to which its parameters belong"
        ),
    }
}

fn whiteness(
    f: &mut Formatter<'_>,
    residual: &Residual,
    test: &CorrelationTest,
    span: Option<&NoiseSpan>,
    name_of_force: &dyn Fn(usize) -> String,
) -> fmt::Result {
    match residual {
        Residual::Samples { residual } => write!(f, "residual {}: ", residual + 1)?,
        Residual::Lines { residual } => write!(f, "lines of residual {}: ", residual + 1)?,
        Residual::FrequencyResponse { response, force, distance } => {
            let (response, force) = (response + 1, name_of_force(*force));
            write!(
                f,
                "residual of response {response} to {force}, lines {distance} or more apart: "
            )?;
        }
    }
    if test.rounding {
        return write!(f, "{test}");
    }
    let significant = span.filter(|_| test.is_significant());
    if let Some(NoiseSpan { lags, first_coefficient, beyond }) = significant {
        return write!(
            f,
            "correlated up to lag {lags} ({first_coefficient:.2} at lag 1) and no further ({beyond}), \
             as noise on the response does, which least squares takes as exact: the parameters are \
             biased by more than their standard errors"
        );
    }
    write!(f, "{test}; ")?;
    f.write_str(match (residual, test.is_significant()) {
        (Residual::Samples { .. }, false) => "white",
        (Residual::Samples { .. }, true) => {
            "not white: coloured noise, or an incomplete model; do not rely on the intervals"
        }
        (Residual::Lines { .. } | Residual::FrequencyResponse { .. }, false) => {
            "uncorrelated from line to line"
        }
        (Residual::Lines { .. }, true) => {
            "correlated from line to line: a transient or leakage, as of an unmeasured force, or an \
             error of the model; use later periods"
        }
        (Residual::FrequencyResponse { .. }, true) => {
            "correlated from line to line: a missing mode, another error of the model, or segments too \
             short for the damping"
        }
    })
}

impl Display for CorrelationTest {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { coefficients, outside, bound, p_value, rounding } = self;
        if *rounding {
            return f.write_str("rounding");
        }
        write!(
            f,
            "{outside} of {coefficients} correlations beyond the 95 % bound of {bound:.3} ({p_value})"
        )
    }
}

impl Display for PValue {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // A distribution function does not resolve the rest.
        match self.raw {
            p if p < 1e-15 => return f.write_str("p < 1e-15"),
            p if p < 1e-3 => write!(f, "p = {p:.1e}")?,
            p => write!(f, "p = {p:.3}")?,
        }
        match self.adjusted {
            p if p == self.raw => Ok(()),
            p if p < 1e-3 => write!(f, ", {p:.1e} adjusted"),
            p => write!(f, ", {p:.3} adjusted"),
        }
    }
}

impl Display for NoiseSource {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            NoiseSource::Periods => "estimated from the periods",
            NoiseSource::Coherence => "that follows from the coherence",
            NoiseSource::Force => "where that of the force decides",
        })
    }
}

impl Display for Reference {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Reference::NeighbouringSamples => "instrumental variables (neighbouring samples)",
            Reference::MaximumLikelihood => "maximum likelihood (first step)",
        })
    }
}

impl Display for Power {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Power::Square => "square of",
            Power::Cube => "cube of",
            Power::VelocityCube => "cube of the velocity of",
            Power::VelocitySign => "sign (dry friction) of the velocity of",
        })
    }
}

impl Display for Quantity {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Quantity::Force => f.write_str("force"),
            Quantity::Response(motion) => motion.fmt(f),
        }
    }
}

impl Display for Channel {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.quantity, self.index + 1)
    }
}

impl Display for Verdict {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Verdict::Good => "good",
            Verdict::Doubtful => "doubtful",
            Verdict::Bad => "bad",
        })
    }
}

/// A number with six digits at most.
fn up_to_six_digits(value: f64) -> String {
    let text = six_digits(value);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        text
    }
}

/// The sentence of a unit: its factor, if it is understood, and whether the factor is used.
fn unit(
    f: &mut Formatter<'_>,
    column: &str,
    text: &str,
    (factor, used): (Option<f64>, bool),
    si: &str,
) -> fmt::Result {
    let factor = factor.map(message::number);
    match (factor, used) {
        (Some(factor), true) => write!(
            f,
            "\"{text}\" in the header of column {column} is read as a unit: the numbers are multiplied by {factor} to get \
             {si}; if this is wrong, state the unit (`unit`) or the factor (`scale`)"
        ),
        (Some(factor), false) => write!(
            f,
            "\"{text}\" in the header of column {column} may be a unit with the factor {factor}, and the numbers are taken \
             as {si} without it: state the unit (`unit`) or the factor (`scale`)"
        ),
        (None, _) => write!(
            f,
            "\"{text}\" in the header of column {column} is not understood, and the numbers are taken as {si}: state the unit \
             (`unit`) or the factor (`scale`)"
        ),
    }
}

impl Display for Subject {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Subject::Excitation => "excitation",
            Subject::Unit => "unit",
            Subject::Conditioning => "conditioning",
            Subject::Range => "range",
            Subject::Kinematics => "kinematics",
            Subject::Power => "power",
            Subject::Periodicity => "periodicity",
            Subject::Step => "step",
            Subject::Coherence => "coherence",
            Subject::Leakage => "leakage",
            Subject::Delay => "delay",
            Subject::Bias => "bias",
            Subject::Instability => "instability",
            Subject::Mass => "mass",
            Subject::Symmetry => "symmetry",
            Subject::Misfit => "misfit",
            Subject::Linearity => "linearity",
            Subject::Whiteness => "whiteness",
            Subject::CrossCorrelation => "cross-correlation",
        })
    }
}

/// Words as `a`, `a and b`, `a, b and c`.
fn listed(words: &[String]) -> String {
    match words {
        [all @ .., last] if !all.is_empty() => format!("{} and {last}", all.join(", ")),
        _ => words.concat(),
    }
}

/// A number with enough digits to name a line.
fn line_hz(value: f64) -> String {
    message::number(format!("{value:.5e}").parse().unwrap_or(value)).to_string()
}

/// A number with three significant digits.
fn three_digits(value: f64) -> String {
    message::number(format!("{value:.2e}").parse().unwrap_or(value)).to_string()
}

/// A number with six significant digits.
fn six_digits(value: f64) -> String {
    let exponent = value.abs().log10().floor();
    match exponent {
        e if (-4.0..6.0).contains(&e) => format!("{value:.0$}", (5.0 - e) as usize),
        _ => format!("{value:.5e}"),
    }
}
