//! Figures of the report.

use mechid_analysis::AnalysisError;
use mechid_analysis::identify::Identified;
use mechid_analysis::identify::prediction::Compared;
use mechid_analysis::measurement::Block;
use mechid_analysis::review::RecordReview;
use mechid_analysis::review::receptance::Receptance;
use mechid_analysis::review::reconstruction::Reconstruction;
use mechid_analysis::review::residual::{Correlations, OwnCorrelation, Residual};
use mechid_analysis::review::whole::Gathered;
use mechid_model::ResponseQuantity;
use mechid_plot::{Axis, Color, Curve, Dash, Figure, FigureSet, Legend, Panel, Reference};
use mechid_signal::{Record, Spectrum};

use super::alone::shape_figures;
use super::{Captions as _, Contents};
use crate::FigureStyle;
use crate::ReportError;
use crate::figures::receptance::{self as picture, Names};
use crate::figures::shapes::ModeShapes;
use crate::figures::{displacement_name, restoring as surface};

/// Width of a figure, px: a screen shows two figures in a row, and the numbers of a figure are
/// legible on a telephone.
const WIDTH: f64 = 480.0;

/// Width of a figure that fills a row, px.
const WIDE: f64 = 760.0;

/// Heights of panels with their labels, px: of the first panel in a figure, and of each other
/// panel.
const PANEL: [f64; 2] = [190.0, 150.0];

/// Heights of the panels, with their labels, in a figure that fills a row, px: of the first panel,
/// and of each other panel.
const WIDE_PANEL: [f64; 2] = [300.0, 180.0];

/// Maximum number of figures in a set for the smaller width [`WIDTH`]; a set of more figures has
/// the width [`WIDE`].
const BESIDE: usize = 4;

/// Figure with its caption.
pub(crate) struct Drawn {
    pub id: String,
    pub svg: String,
    /// Name and small drawing of each figure, to choose one; empty for a single figure.
    pub map: Vec<(String, String)>,
    pub caption: String,
    /// `true` if the figure fills a row.
    pub is_wide: bool,
}

pub(super) fn drawn(id: String, figure: Figure, caption: String) -> Result<Drawn, ReportError> {
    drawn_set(id, vec![(String::new(), figure)], caption)
}

/// Draws a set of figures; the page shows one figure large and all figures small.
pub(super) fn drawn_set(
    id: String,
    members: Vec<(String, Figure)>,
    caption: String,
) -> Result<Drawn, ReportError> {
    let width = if members.len() > BESIDE { WIDE } else { WIDTH };
    drawn_at(width, id, members, caption)
}

/// Draws a set of figures that fills a row of the page.
pub(super) fn drawn_large(
    id: String,
    members: Vec<(String, Figure)>,
    caption: String,
) -> Result<Drawn, ReportError> {
    drawn_at(WIDE, id, members, caption)
}

fn drawn_at(
    width: f64,
    id: String,
    members: Vec<(String, Figure)>,
    caption: String,
) -> Result<Drawn, ReportError> {
    let is_alone = members.len() == 1;
    let sized = members.into_iter().map(|(name, figure)| {
        let title = if is_alone { "" } else { name.as_str() };
        let figure = sized(figure.titled(title), width);
        (name, figure)
    });
    let drawn = FigureSet::new(sized).draw(&id, &caption)?;
    Ok(Drawn { id, svg: drawn.svg, map: drawn.map, caption, is_wide: width == WIDE })
}

/// Returns the figure with this width, px, and with the height that its rows and its legend need.
fn sized(figure: Figure, width: f64) -> Figure {
    let panels = figure.panels();
    // The legend of many curves needs several rows.
    let curves = panels.iter().map(|panel| panel.data().len()).max().unwrap_or(0);
    let [first, other] = if width > WIDTH { WIDE_PANEL } else { PANEL };
    let height = first + other * (figure.rows() as f64 - 1.0).max(0.5) + 12.0 * curves as f64;
    figure.size(width, height)
}

fn times(record: &Record) -> Vec<f64> {
    record.sampling().times().collect()
}

/// Draws a figure for each channel, with its name and unit: the time history of the window above
/// the amplitudes of the mean period. The time history has the samples of `held` if these are all
/// samples, otherwise the extremes in `whole`.
fn history(
    (name, unit): (&dyn Fn(usize) -> String, &str),
    (held, whole): (&Record, &Gathered),
    period: &Record,
    channels: &[usize],
) -> Vec<(String, Figure)> {
    let spectrum = Spectrum::from_record(period);
    let hz: Vec<f64> = (1..spectrum.len()).map(|n| spectrum.frequency_hz(n)).collect();
    let of_channel = |&c: &usize| {
        let label = name(c);
        let (t, values) = whole.history(held, c);
        let time = Panel::new(Axis::linear("Time in the window", "s"), Axis::linear(&label, unit));
        let time = time.curve(Curve::line("", &t, &values).width(1.0));
        let amplitude: Vec<f64> = (1..spectrum.len()).map(|n| spectrum.line(n, c).norm()).collect();
        let axis = Axis::linear(format!("Amplitude of {label}"), unit);
        let stems = Curve::stems("", &hz, &amplitude).color(Color::VERMILION);
        let lines = Panel::new(Axis::linear("Frequency", "Hz"), axis).curve(stems);
        (label, Figure::new("").panel(time).panel(lines))
    };
    channels.iter().map(of_channel).collect()
}

/// Returns the measured values as a thick line, and the modelled values as a thin line on top.
fn overlay(t: &[f64], measured: &[f64], name: &str, modelled: &[f64]) -> [Curve; 2] {
    [
        Curve::line("measured", t, measured).color(Color::GREY).width(2.6),
        Curve::line(name, t, modelled).color(Color::BLUE).width(1.1).dash(Dash::Solid),
    ]
}

/// Draws time histories and spectra of force and response.
pub fn data(part: &RecordReview<'_>) -> Result<Vec<Drawn>, ReportError> {
    let (held, period) = (part.held(), part.period());
    let (motion, kind) = held.response();
    let of = match (&part.lines, held.periods) {
        (Some(_), 1) => "the period".into(),
        (Some(_), _) => "the mean period".into(),
        (None, _) => match held.held_to() {
            None => "the window taken as one period".into(),
            Some(last) => {
                format!("samples {} to {last} taken as one period", held.first_sample)
            }
        },
    };
    let all_channels: Vec<usize> = (0..motion.channels()).collect();
    let of_force = (&held.force, &part.whole.force);
    let of_motion = (motion, &part.whole.motions[0]);
    Ok(vec![
        drawn_set(
            part.id("force"),
            history(
                (&|dof| held.names.force_name(dof), "N"),
                of_force,
                &period.force,
                &held.driven,
            ),
            format!("Measured force: time history of the window, and line amplitudes of {of}."),
        )?,
        drawn_set(
            part.id("motion"),
            history(
                (&|dof| held.names.response_name(kind, dof), kind.unit()),
                of_motion,
                period.response().0,
                &all_channels,
            ),
            format!("Measured {kind}: time history of the window, and line amplitudes of {of}."),
        )?,
    ])
}

/// Draws measured and identified receptance; if the responses to the forces cannot be separated at
/// any line, draws measured and predicted response.
///
/// # Errors
/// [`ReportError::Analysis`] if the system has no receptance at a line, [`ReportError::Plot`] if
/// the figure cannot be drawn.
pub fn receptance(identified: &Identified, measured: &Receptance) -> Result<Drawn, ReportError> {
    let system = identified.estimate().system().map_err(AnalysisError::from)?;
    let origin = &measured.origin;
    let (style, channels) = (FigureStyle::default(), identified.names());
    let kind = measured.data.measured();
    let names = Names {
        displacement: &|dof| channels.response_name(kind, dof),
        force: &|dof| channels.force_name(dof),
    };
    let coherence = measured.coherence.as_ref();
    let below = match coherence {
        Some(coherence) => format!(
            " Below, the part of the response power that is linearly related to the forces (coherence), from {}.",
            coherence.averages
        ),
        None => String::new(),
    };
    if let Some(set) = picture::receptance_set(&measured.data, &system, names, style, coherence)? {
        let pairs = measured.data.dof().pow(2);
        let left_out = match set.len() {
            picture::DRAWN_PAIRS if pairs > picture::DRAWN_PAIRS => {
                format!(
                    " Only the first {} pairs of response and force are drawn.",
                    picture::DRAWN_PAIRS
                )
            }
            _ => String::new(),
        };
        let caption = format!(
            "Response per unit force of the identified machine and of the record, {origin}.{below}{left_out}"
        );
        return drawn_set("receptance".into(), set, caption);
    }
    let caption = format!(
        "Amplitude of the response, {origin}, and the amplitude that the identified machine \
         predicts from the forces. No receptance is shown, because {}.{below}",
        picture::WHY
    );
    let names = Names { displacement: &|dof| displacement_name(channels, kind, dof), ..names };
    let figure = picture::responses("", &measured.data, &system, names, style)?;
    let figure = match coherence {
        Some(coherence) => {
            let name = |dof| channels.response_name(kind, dof);
            figure.panel(picture::coherence(coherence, &name, style))
        }
        None => figure,
    };
    drawn("receptance".into(), figure, caption)
}

/// Draws measured and modelled response with the residual, over one period or the whole open
/// record.
pub fn fit(part: &RecordReview<'_>, compared: &Compared) -> Result<Drawn, ReportError> {
    let block = part.held();
    let extent = extent(block);
    let caption = format!(
        "Measured {}, and the prediction of the identified machine for the measured force {extent}; \
         below, their difference.",
        compared.kind
    );
    over_time(part.id("fit"), compared, shown(block), caption)
}

/// Draws measured and predicted response, with their difference, for a record that was not fitted.
pub fn validation(source: &Block, compared: &Compared) -> Result<Drawn, ReportError> {
    let extent = extent(source);
    let caption = format!(
        "{}: measured and predicted {} {extent}; below, their difference.",
        source.file, compared.kind
    );
    over_time("validation".into(), compared, shown(source), caption)
}

/// Returns the number of samples of a response that are drawn.
fn shown(source: &Block) -> usize {
    source.period.min(source.force.len())
}

fn extent(source: &Block) -> String {
    let (first, shown) = (source.first_sample, shown(source));
    match source.periods {
        _ if shown < source.period => format!("over samples {first} to {}", first + shown - 1),
        1 => "over the window".into(),
        _ => "over the first period".into(),
    }
}

/// Draws the first samples of a response, measured and modelled, above their difference.
fn over_time(
    id: String,
    compared: &Compared,
    samples: usize,
    caption: String,
) -> Result<Drawn, ReportError> {
    let unit = compared.kind.unit();
    let measured = compared.measured.window(0, samples)?;
    let modelled = compared.predicted.window(0, samples)?;
    let t = times(&measured);
    let of_channel = |c: usize| {
        let name = &compared.names[c];
        let time = || Axis::linear("Time in the window", "s");
        let (x, model) = (measured.channel(c), modelled.channel(c));
        let residual: Vec<f64> = x.iter().zip(model).map(|(x, model)| x - model).collect();
        let both = Panel::new(time(), Axis::linear(name, unit))
            .curves(overlay(&t, x, "modelled", model))
            .legend(Legend::Above);
        let residual_curve = Curve::line("", &t, &residual).color(Color::VERMILION).width(1.0);
        let below = Panel::new(time(), Axis::linear(format!("Residual of {name}"), unit));
        (name.clone(), Figure::new("").share_x().panel(both).panel(below.curve(residual_curve)))
    };
    drawn_set(id, (0..measured.channels()).map(of_channel).collect(), caption)
}

/// Draws the amplitudes of response and residual on the fitted lines of a period, or on all lines
/// if no lines of a period were fitted.
pub fn residual_spectrum(
    part: &RecordReview<'_>,
    residual: &Residual,
) -> Result<Drawn, ReportError> {
    let compared = residual.mean.as_ref().unwrap_or(&residual.compared[0]);
    let motion = &compared.measured;
    let residual = Record::new(motion.sampling(), motion.data() - compared.predicted.data())?;
    let (motion, residual) = (Spectrum::from_record(motion), Spectrum::from_record(&residual));
    let mut shown = part.lines.clone().unwrap_or_else(|| (1..motion.len()).collect());
    shown.sort_unstable();
    let unit = compared.kind.unit();
    let of_channel = |c: usize| {
        let points = |spectrum: &Spectrum| -> (Vec<f64>, Vec<f64>) {
            let point = |n: &usize| (spectrum.frequency_hz(*n), spectrum.line(*n, c).norm());
            // A logarithmic axis cannot show zero.
            shown.iter().map(point).filter(|(_, amplitude)| *amplitude > 0.0).unzip()
        };
        let axis = Axis::log10(format!("Amplitude of {}", compared.names[c]), unit);
        let mut panel = Panel::new(Axis::linear("Frequency", "Hz"), axis).legend(Legend::Above);
        for (name, spectrum, slot) in [("measured", &motion, 0), ("residual", &residual, 1)] {
            let (hz, amplitude) = points(spectrum);
            if !hz.is_empty() {
                panel = panel.curve(Curve::points(name, &hz, &amplitude).slot(slot));
            }
        }
        (compared.names[c].clone(), Figure::new("").panel(panel))
    };
    drawn_set(
        part.id("residual-spectrum"),
        (0..motion.channels()).map(of_channel).collect(),
        format!(
            "{}: the spectrum of pure noise is flat. If the model omits an effect, the \
             residual has a spectrum like that of a resonance or of the force.",
            part.period_caption(&format!(
                "Spectra of the measured {} and of the residual",
                compared.kind
            ))
        ),
    )
}

/// Returns the panel of a correlation coefficient, with bounds that contain 95 % of the
/// coefficients of noise.
fn correlation_panel(
    x: Axis,
    residual: &str,
    what: &str,
    at: &[f64],
    coefficients: &[f64],
    bound: f64,
) -> Panel {
    Panel::new(x, Axis::linear(format!("{residual}: {what}"), ""))
        .curve(Curve::stems("", at, coefficients).color(Color::BLUE))
        .reference(Reference::horizontal("95 % bound of noise", bound))
        .reference(Reference::horizontal("", -bound))
        .legend(Legend::Above)
}

/// Returns the panel of the autocorrelation of a residual.
fn own_panel(residual: &str, own: &OwnCorrelation) -> Panel {
    match own {
        OwnCorrelation::Samples { correlation, .. } => {
            let (r, bound) = (&correlation.coefficients, correlation.bound);
            let lags: Vec<f64> = (1..).take(r.len()).map(f64::from).collect();
            let x = Axis::linear("Lag", "samples");
            correlation_panel(x, residual, "autocorrelation", &lags, r, bound)
        }
        OwnCorrelation::Lines(correlation) => {
            // The real part of a coefficient is drawn at its distance in lines, and the imaginary
            // part 0.2 lines further to the right.
            let distance = |at: usize| (at / 2 + 1) as f64 + 0.2 * (at % 2) as f64;
            let (r, bound) = (&correlation.coefficients, correlation.bound);
            let distances: Vec<f64> = (0..r.len()).map(distance).collect();
            let x = Axis::linear("Distance", "lines");
            correlation_panel(x, residual, "from line to line", &distances, r, bound)
        }
    }
}

/// Draws the autocorrelation of the residual, and its correlation with the forces.
pub fn correlations(
    part: &RecordReview<'_>,
    correlations: &[Correlations],
) -> Result<Drawn, ReportError> {
    let block = part.held();
    let kind = block.response().1;
    let mut members = Vec::new();
    let (mut widest, mut of_lines) = (0, false);
    for (c, channel) in correlations.iter().enumerate() {
        let residual = block.names.response_name(kind, c);
        match &channel.own {
            Some(OwnCorrelation::Samples { span, .. }) => widest = widest.max(*span),
            Some(OwnCorrelation::Lines(_)) => of_lines = true,
            None => {}
        }
        let mut figure = Figure::new("");
        if let Some(own) = &channel.own {
            figure = figure.panel(own_panel(&residual, own));
        }
        for (force, correlation) in &channel.forces {
            let (r, bound) = (&correlation.coefficients, correlation.bound);
            let lag = |at: usize| (at as f64 - (r.len() / 2) as f64) * channel.lag;
            let lags: Vec<f64> = (0..r.len()).map(lag).collect();
            let name = format!("with {}", block.names.force_name(*force));
            let x = Axis::linear("Lag", "s");
            figure = figure.panel(correlation_panel(x, &residual, &name, &lags, r, bound));
        }
        if !figure.panels().is_empty() {
            members.push((residual, figure));
        }
    }
    let what = if of_lines {
        "Correlation of the noise-weighted residual from line to line (real and imaginary \
                 part) and with the force"
            .into()
    } else {
        part.buffered_caption("Autocorrelation of the residual, and its correlation with the force")
    };
    let spanned = match widest {
        0 => String::new(),
        span => {
            format!(" If only the response has noise, the residual is correlated over {span} lags.")
        }
    };
    let caption =
        format!("{what}; for pure noise, 95 % of the stems are between the dashed lines.{spanned}");
    drawn_set(part.id("correlations"), members, caption)
}

/// Draws the mode shapes and their modal assurance criterion. `None` for one degree of freedom, if
/// no mode oscillates, or if the geometry lacks the point of a channel.
pub(super) fn shapes(contents: &Contents<'_>, kind: ResponseQuantity) -> Option<[Drawn; 2]> {
    let report = contents.review.identified.summary();
    let dofs = contents.review.identified.estimate().dof();
    let names: Vec<String> =
        (0..dofs).map(|dof| report.channels.response_name(kind, dof)).collect();
    let shapes = ModeShapes::from_modes(&report.modes, &names, contents.geometry)?;
    Some(shape_figures(&shapes))
}

/// Draws the restoring force of a system with nonlinear terms, for the first record.
pub fn restoring(identified: &Identified) -> Result<Option<Drawn>, ReportError> {
    let Some((fitted, points)) = surface::whole_periods(identified) else { return Ok(None) };
    let caption = "Restoring force of the first record: points of its surface, springs and dampers with \
                   their confidence intervals (up to 1.2 times the measured amplitudes), and the \
                   residual.";
    let figure = surface::figure("first record", fitted, points)?;
    drawn("restoring-force".into(), figure, caption.into()).map(Some)
}

/// Draws the reconstructed and the measured force.
pub fn force(
    part: &RecordReview<'_>,
    reconstruction: &Reconstruction,
) -> Result<Drawn, ReportError> {
    let (force, measured) = (reconstruction.force.record(), &reconstruction.measured);
    let t = times(measured);
    let of_force = |&c: &usize| {
        let (reconstructed, truth) = (force.channel(c), measured.channel(c));
        let name = part.held().names.force_name(c);
        let time = || Axis::linear("Time in the window", "s");
        let both = Panel::new(time(), Axis::linear(&name, "N"))
            .curves(overlay(&t, truth, "computed from the motion", reconstructed))
            .legend(Legend::Above);
        let apart: Vec<f64> = reconstructed.iter().zip(truth).map(|(f, m)| f - m).collect();
        let mut below = Panel::new(time(), Axis::linear(format!("Difference of {name}"), "N"));
        if let Some(error) = reconstruction.force.standard_error() {
            let upper: Vec<f64> = error.channel(c).iter().map(|e| 2.0 * e).collect();
            let lower: Vec<f64> = upper.iter().map(|e| -e).collect();
            below = below
                .curve(Curve::band("± 2 standard errors", &t, &lower, &upper))
                .legend(Legend::Above);
        }
        let difference = Curve::line("", &t, &apart).color(Color::VERMILION).width(1.0);
        (name, Figure::new("").share_x().panel(both).panel(below.curve(difference)))
    };
    drawn_set(
        part.id("reconstructed-force"),
        reconstruction.forced.iter().map(of_force).collect(),
        part.period_caption("Force computed from the motion with the identified machine, and the measured force; below, their difference") + ".",
    )
}
