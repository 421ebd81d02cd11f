//! Pages of results: one figure or one set of figures, with warnings, numbers and details.

use maud::{Markup, html};
use mechid_analysis::bearing::{BearingSummary, BearingTable, CoefficientRow};
use mechid_analysis::frf::table::{AveragedRecord, Response};
use mechid_analysis::identify::checks::CheckRow;
use mechid_analysis::identify::nonlinear::NonlinearSummary;
use mechid_analysis::identify::rows::{ProportionalDamping, Uncertain};
use mechid_analysis::identify::summary::{FitRow, RecordRow};
use mechid_analysis::inspect::channel::{Channel, Cut};
use mechid_analysis::modes::ModeComparison;
use mechid_analysis::reconstruct::summary::{ForceRow, ForceSummary};
use mechid_analysis::text::{compact, significant};
use mechid_analysis::{FrfTable, Identified, IdentifiedResponses, Inspected};
use mechid_model::ResponseQuantity;
use mechid_plot::{Figure, matrix_of_squares};
use mechid_signal::message;

use super::figures::{Drawn, drawn_large};
use super::sections::{identified_tables, machine_tables, pair, percent, predicted, shapes};
use super::tables::Table;
use super::{
    PageSettings, about, base_name, checks, document, figure, names_of, remarks, short_names,
};
use crate::ReportError;

/// Texts and tables of a page in addition to its figures.
pub struct Words {
    /// Heading without the name of the record.
    pub what: &'static str,
    /// Files of the result.
    pub files: Vec<String>,
    /// Further parts of the line below the heading.
    pub subtitle: Vec<String>,
    /// Findings that make the results doubtful.
    pub warnings: Vec<String>,
    /// Findings that support the results.
    pub merits: Vec<String>,
    pub tables: Vec<Markup>,
    /// Caption of the figures.
    pub caption: String,
}

/// Returns a page of figures with the texts and tables of their result: HTML that loads no other
/// file and runs only the script of its figures.
///
/// # Errors
/// [`ReportError::Plot`] if there is no figure, or if a figure cannot be drawn.
pub fn result_page(
    words: &Words,
    figures: Vec<(String, Figure)>,
    settings: &PageSettings,
) -> Result<String, ReportError> {
    let default_title = || format!("{} of {}", words.what, short_names(&words.files));
    let title = settings.title.clone().unwrap_or_else(default_title);
    let drawn = drawn_large("figure".into(), figures, words.caption.clone())?;
    let subtitle = [vec![names_of(&words.files)], words.subtitle.clone()].concat();
    let heading = html! {
        header {
            h1 { (title) }
            p.subtitle { (subtitle.join(" · ")) }
            (about(&settings.about))
            (remarks(&words.warnings, &words.merits))
        }
    };
    let mut sections = Vec::new();
    if !words.tables.is_empty() {
        let tables = html! { div.tables { @for table in &words.tables { (table) } } };
        sections.push(("numbers", "Numbers", tables));
    }
    sections.push(("drawn", "Figure", html! { div.figures { (figure(&drawn)) } }));
    Ok(document(&title, &heading, &sections, settings.command.as_deref(), &words.files))
}

/// Returns two lists: the warnings (conspicuous checks, then remarks), and the findings that
/// support the result.
fn verdicts(found: &[CheckRow], remarks: &[String]) -> (Vec<String>, Vec<String>) {
    let warnings = checks::conspicuous(found).into_iter().chain(remarks.iter().cloned());
    (warnings.collect(), checks::merits(found))
}

/// Draws the modal assurance criterion of each mode of the first set (rows) with each of the second
/// (columns), as SVG.
pub fn comparison_svg(found: &ModeComparison) -> String {
    let label = format!(
        "Similarity of the mode shapes (modal assurance criterion): rows are the modes of {}, columns those of {}",
        base_name(&found.sets[0]),
        base_name(&found.sets[1])
    );
    matrix_of_squares(&found.mac, &label)
}

/// Returns a page of the comparison of two sets of modes: HTML that loads no other file and runs
/// only the script of figures.
pub fn comparison_page(found: &ModeComparison, settings: &PageSettings) -> String {
    let [first, second] = [0, 1].map(|at| base_name(&found.sets[at]));
    let default_title = || format!("Modes of {first} and {second}");
    let title = settings.title.clone().unwrap_or_else(default_title);
    let heading = html! { header { h1 { (title) } (about(&settings.about)) } };
    let caption = format!(
        "Similarity of the mode shapes (modal assurance criterion): 1 for the same shape, 0 for orthogonal ones; rows \
         are the modes of {first}, columns those of {second}."
    );
    let drawn = Drawn {
        id: "assurance".into(),
        svg: comparison_svg(found),
        map: Vec::new(),
        caption,
        is_wide: false,
    };
    let sections = [
        ("numbers", "Numbers", as_text(&found.to_string())),
        ("shapes", "Mode shapes", html! { div.figures { (figure(&drawn)) } }),
    ];
    document(&title, &heading, &sections, settings.command.as_deref(), &found.sets)
}

/// Returns a text with aligned columns, as a program prints it.
fn as_text(text: &str) -> Markup {
    html! { div.scroll role="region" tabindex="0" aria-label="Result" { pre { code { (text.trim_end()) } } } }
}

/// Returns texts and tables for the page of a bearing at one speed.
pub fn bearing_words(found: &BearingSummary) -> Words {
    let (warnings, merits) = verdicts(&found.checks, &found.remarks);
    let mut subtitle = Vec::new();
    if !found.baseline.is_empty() {
        subtitle.push(format!("minus the baseline {}", found.baseline.join(", ")));
    }
    subtitle.extend(found.rotation_hz.map(|hz| format!("{} Hz rotation", compact(hz, 6))));
    subtitle.extend(found.load.map(|load| format!("{} N load", compact(load, 6))));
    subtitle.push(format!("housing of {} kg", compact(found.analysis.stator_mass, 6)));
    let excluded = match found.left_out_hz.len() {
        0 => String::new(),
        count => format!(", {count} excluded because of the rotation"),
    };
    subtitle.push(format!("{}{excluded}", message::count(found.lines, "line")));
    let mut tables = coefficients_of_bearing(found);
    let rows = fit_of_bearing(found);
    tables.push(Table { caption: "The fit", header: &[], numbers_from: 9, rows }.html());
    let caption =
        "Dynamic stiffness of the film, line by line and fitted, direct and cross-coupled: \
                   real part against ω², imaginary part against ω."
            .to_owned();
    Words {
        what: "Bearing coefficients",
        files: found.tests.clone(),
        subtitle,
        warnings,
        merits,
        tables,
        caption,
    }
}

/// Returns the coefficients of the film, and the stability of a rigid rotor on it.
fn coefficients_of_bearing(found: &BearingSummary) -> Vec<Markup> {
    let interval = format!("{} % interval", compact(100.0 * found.confidence, 3));
    let cells = |name: &str, estimate: &Uncertain, unit: &str| {
        let [value, error, interval] = match found.error_scale {
            Some(_) => estimate.cells(),
            None => [significant(estimate.value, 6), "withheld".into(), String::new()],
        };
        vec![name.to_owned(), value, error, interval, unit.to_owned()]
    };
    let table = |caption: &str, what, rows: Vec<Vec<String>>| {
        let header = [what, "value", "±", interval.as_str(), "unit"];
        Table { caption, header: &header, numbers_from: 1, rows }.html()
    };
    let coefficients = |caption, rows: &[CoefficientRow]| {
        let rows = rows.iter().map(|row| cells(row.name, &row.estimate, row.unit)).collect();
        table(caption, "coefficient", rows)
    };
    let mut tables = vec![coefficients("Coefficients of the film", &found.coefficients)];
    if let Some(scaled) = &found.dimensionless {
        tables.push(coefficients("Dimensionless coefficients", &scaled.coefficients));
    }
    if let Some(stability) = &found.stability {
        let row = |name: &str, value: &Option<Uncertain>, unit: &str| match value {
            Some(value) => cells(name, value, unit),
            None => {
                vec![name.into(), "none: stable".into(), String::new(), String::new(), unit.into()]
            }
        };
        let rows = vec![
            row("whirl frequency ratio", &stability.whirl_frequency_ratio, "–"),
            row("critical mass per bearing", &stability.critical_mass, "kg"),
        ];
        tables.push(table("Rigid rotor on this film", "threshold", rows));
    }
    tables
}

fn fit_of_bearing(found: &BearingSummary) -> Vec<Vec<String>> {
    let mut rows = vec![
        pair("Power of the residual / power of the noise", significant(found.misfit_ratio, 3)),
        pair("Condition number", significant(found.condition_number, 3)),
    ];
    if let Some(test) = &found.inertia_test {
        let (statistic, p) = (significant(test.statistic, 3), significant(test.p_value, 2));
        let text = format!("{statistic} with {} coefficients, p = {p}", test.restrictions);
        rows.push(pair("Likelihood ratio of the inertia", text));
    }
    if let Some(amplitude) = &found.amplitude {
        let share = amplitude.over_clearance.map_or(String::new(), |share| {
            format!(" ({} of the clearance)", significant(share, 2))
        });
        let text = format!("{} m{share}", significant(amplitude.largest_displacement, 3));
        rows.push(pair("Largest relative displacement", text));
    }
    if let Some(number) = found.dimensionless.as_ref().and_then(|all| all.sommerfeld_number) {
        rows.push(pair("Sommerfeld number", significant(number, 4)));
    }
    rows
}

/// Returns texts and tables for the page of a bearing at several speeds and loads.
pub fn campaign_words(found: &BearingTable) -> Words {
    let of_all = found.rows.iter().map(|row| verdicts(&row.checks, &row.remarks).0);
    let files: Vec<String> = found.rows.iter().flat_map(|row| row.tests.iter().cloned()).collect();
    Words {
        what: "Bearing coefficients",
        files,
        subtitle: vec![message::count(found.rows.len(), "speed or load")],
        warnings: of_all.flatten().collect(),
        merits: Vec::new(),
        tables: vec![as_text(&found.to_string())],
        caption: "Coefficients over the speed of rotation, with their 95 % intervals.".into(),
    }
}

/// Returns texts and tables for the page of a reconstructed force.
pub fn force_words(found: &ForceSummary) -> Words {
    let extent = match found.periods {
        None => "open record".to_owned(),
        Some(1) => "one period".into(),
        Some(n) => format!("mean of {n} periods"),
    };
    let samples = message::count(found.samples, "sample");
    let error = if found.machine_uncertainty && !found.noise_uncertainty {
        "standard error (machine only), N"
    } else {
        "standard error, N"
    };
    let row = |force: &ForceRow| {
        let name = force.name.clone();
        if !force.sought {
            return vec![name, "taken as zero".into(), String::new(), String::new(), String::new()];
        }
        let error = force.standard_error.map_or("not known".into(), |error| significant(error, 2));
        let (amplitude, hz) =
            (significant(force.strongest_amplitude, 4), compact(force.strongest_hz, 5));
        let [rms, peak] = [force.rms, force.peak].map(|value| significant(value, 4));
        vec![name, rms, error, peak, format!("{amplitude} N at {hz} Hz")]
    };
    let header = ["force", "RMS, N", error, "peak, N", "strongest line"];
    let rows = found.forces.iter().map(row).collect();
    let facts = facts_of_force(found);
    Words {
        what: "Force in the record",
        files: vec![found.file.clone()],
        subtitle: vec![format!("{samples} at {} Hz", compact(found.sample_rate_hz, 8)), extent],
        warnings: found.remarks.clone(),
        merits: Vec::new(),
        tables: vec![
            Table { caption: "Forces", header: &header, numbers_from: 1, rows }.html(),
            Table { caption: "How they were found", header: &[], numbers_from: 9, rows: facts }
                .html(),
        ],
        caption: "Force over time, and its amplitudes over frequency.".into(),
    }
}

/// Returns machine and method, and how well the force explains the responses.
fn facts_of_force(found: &ForceSummary) -> Vec<Vec<String>> {
    let mut facts = vec![
        pair("Machine", base_name(&found.machine)),
        pair("Method", found.method),
        pair("Reason", &found.why),
    ];
    for chosen in &found.chosen {
        let value = format!("{} {}", compact(chosen.value, 5), chosen.unit);
        facts.push(pair(&chosen.name, value.trim_end()));
    }
    for channel in &found.channels {
        let Some(share) = channel.unexplained else { continue };
        let expected = channel
            .expected
            .map_or(String::new(), |share| format!(", expected {}", percent(share)));
        let name = format!("Unexplained part of {}", channel.column);
        facts.push(pair(&name, format!("{}{expected}", percent(share))));
    }
    if let Some(band) = found.band_hz {
        let [low, high] = band.map(|hz| significant(hz, 4));
        facts.push(pair(
            "Frequency band of the force and of its standard error",
            format!("{low} to {high} Hz"),
        ));
    }
    facts
}

/// Returns texts and tables for the page of frequency responses.
pub fn response_words(found: &FrfTable) -> Words {
    let row = |response: &Response| {
        let largest = response.magnitude.iter().copied().enumerate();
        let larger = |a: (usize, f64), b: (usize, f64)| if b.1 > a.1 { b } else { a };
        let (at, largest) = largest.fold((0, 0.0), larger);
        let mut coherence = found.coherence[response.motion - 1].values.clone();
        coherence.sort_by(f64::total_cmp);
        vec![
            found.pair(response),
            format!("{} {}", significant(largest, 4), found.unit),
            format!("{} Hz", significant(found.frequency_hz[at], 5)),
            format!("{:.4}", coherence[0]),
            format!("{:.4}", coherence[coherence.len() / 2]),
        ]
    };
    let header = ["response", "largest magnitude", "at", "least coherence", "median"];
    let rows = found.responses.iter().map(row).collect();
    let record = |record: &AveragedRecord| {
        let (first, last) = (record.first_sample, record.last_sample);
        pair(&record.file, format!("samples {first} to {last}, {} segments", record.segments))
    };
    let records = found.records.iter().map(record).collect();
    let mut tables = vec![
        Table { caption: "Responses", header: &header, numbers_from: 1, rows }.html(),
        Table {
            caption: "Records",
            header: &["file", "what was used"],
            numbers_from: 9,
            rows: records,
        }
        .html(),
    ];
    let excluded = found.hits.iter().filter(|hit| !hit.used);
    let excluded: Vec<_> = excluded.map(|hit| pair(&hit.record, hit.to_string())).collect();
    if !excluded.is_empty() {
        let header = ["record", "hit"];
        let table =
            Table { caption: "Excluded hits", header: &header, numbers_from: 9, rows: excluded };
        tables.push(table.html());
    }
    let averages = compact(found.segments.averages, 4);
    let samples = message::count(found.segments.samples, "sample");
    Words {
        what: "Frequency responses",
        files: found.records.iter().map(|record| record.file.clone()).collect(),
        subtitle: vec![
            found.estimator.to_owned(),
            format!(
                "{} segments of {samples}, equivalent to {averages} averages",
                found.segments.count
            ),
            message::count(found.frequency_hz.len(), "line"),
            format!("{} Hz", compact(found.sample_rate_hz, 8)),
        ],
        warnings: found.remarks.clone(),
        merits: Vec::new(),
        tables,
        caption: "Response per unit force, and its coherence.".into(),
    }
}

/// Returns texts and tables for the page of the contents of a record.
pub fn record_words(inspected: &Inspected) -> Words {
    let summary = inspected.summary();
    let mut subtitle = vec![
        summary.format.clone(),
        message::count(summary.columns, "column"),
        message::count(summary.samples, "sample"),
    ];
    if let Some(window) = &summary.window {
        subtitle.push(format!("shown: samples {} to {}", window.first_sample, window.last_sample));
    }
    subtitle.push(match &summary.sampling {
        Some(s) => format!("{} Hz, {} s long", compact(s.rate_hz, 8), compact(s.duration_s, 6)),
        None => "no time axis: give `time` or `sample_rate`".into(),
    });
    let clipped = |channel: &Channel| {
        let Cut { level, samples } = channel.clipping.as_ref()?;
        let (title, level) = (channel.title(), significant(*level, 5));
        Some(format!(
            "column {title} is clipped at {level}: {samples} samples have this value, always three or more in a row"
        ))
    };
    let mut warnings: Vec<String> = summary.channels.iter().filter_map(clipped).collect();
    warnings.extend(summary.remarks.iter().cloned());
    warnings.extend(summary.left_out.iter().map(|reason| format!("left out: {reason}")));
    let spectra = match inspected.spectral_samples() {
        Some((first, last)) => format!(" The spectra are those of samples {first} to {last}."),
        None => String::new(),
    };
    Words {
        what: "Contents",
        files: vec![summary.file.clone()],
        subtitle,
        warnings,
        merits: Vec::new(),
        tables: tables_of_record(inspected),
        caption: format!("Time history of the column, and its amplitude spectrum.{spectra}"),
    }
}

fn tables_of_record(inspected: &Inspected) -> Vec<Markup> {
    let summary = inspected.summary();
    let levels = |c: &Channel| {
        let mut row = vec![c.title()];
        row.extend([c.mean, c.rms, c.peak].map(|value| significant(value, 5)));
        row.push(c.crest_factor.map_or("–".into(), |value| significant(value, 4)));
        row.extend([c.minimum, c.maximum].map(|value| significant(value, 5)));
        row
    };
    let unit = if summary.sampling.is_some() { "Hz" } else { "cycles/sample" };
    let lines = |c: &Channel| {
        let (period, mismatch) = match &c.period {
            Some(period) => (period.samples.to_string(), percent(period.mismatch)),
            None => ("–".into(), "–".into()),
        };
        let peak = |peak: &mechid_analysis::inspect::channel::SpectrumPeak| {
            let frequency = peak.frequency_hz.unwrap_or(peak.cycles_per_sample);
            format!("{}: {}", compact(frequency, 5), significant(peak.amplitude, 3))
        };
        let peaks: Vec<String> = c.spectrum_peaks.iter().map(peak).collect();
        vec![c.title(), period, mismatch, peaks.join(", ")]
    };
    let header = ["column", "mean", "RMS", "peak", "crest factor", "minimum", "maximum"];
    let rows = summary.channels.iter().map(levels).collect();
    let mut tables =
        vec![Table { caption: "Levels", header: &header, numbers_from: 1, rows }.html()];
    let rows: Vec<_> = summary.channels.iter().filter(|c| c.spectral).map(lines).collect();
    if !rows.is_empty() {
        let amplitudes = format!("strongest lines, {unit}: amplitude");
        let header = ["column", "period, samples", "mismatch", &amplitudes];
        tables.push(Table { caption: "Lines", header: &header, numbers_from: 1, rows }.html());
    }
    let scalars = summary.scalars.iter().map(|scalar| pair(&scalar.name, scalar.value.to_string()));
    let rows: Vec<_> = scalars.collect();
    if !rows.is_empty() {
        tables.push(Table { caption: "Single numbers", header: &[], numbers_from: 9, rows }.html());
    }
    tables
}

/// Returns the quality of a fit.
fn fit_table(fit: &FitRow, model: &str) -> Markup {
    Table { caption: "The fit", header: &[], numbers_from: 9, rows: fit.rows(model) }.html()
}

/// Returns texts and tables for the page of an identified machine.
pub fn identified_words(identified: &Identified) -> Words {
    let summary = identified.summary();
    let (warnings, merits) = verdicts(&summary.checks, &summary.remarks);
    let mut tables = identified_tables(summary);
    let model = if summary.nonlinear.is_some() { "model" } else { "linear model" };
    tables.push(fit_table(&summary.fit, model));
    let record = |RecordRow { file, window }: &RecordRow| {
        let (first, last) = (window.first_sample, window.last_sample);
        pair(file, format!("samples {first} to {last}, {} Hz", compact(window.sample_rate_hz, 8)))
    };
    let rows = summary.records.iter().map(record).collect();
    let header = ["file", "what was used"];
    tables.push(Table { caption: "Records", header: &header, numbers_from: 9, rows }.html());
    tables.extend(summary.validation.as_ref().map(predicted));
    if summary.unscaled.is_some() {
        let kind = summary.channels.first_response().unwrap_or(ResponseQuantity::Displacement);
        tables.push(shapes(&summary.modes, |dof| summary.channels.response_name(kind, dof)));
    }
    let nonlinear = summary.nonlinear.as_ref().map(NonlinearSummary::text).unwrap_or_default();
    if !nonlinear.is_empty() {
        tables.push(as_text(&nonlinear));
    }
    Words {
        what: "Identification",
        files: summary.records.iter().map(|record| record.file.clone()).collect(),
        subtitle: vec![summary.estimator.to_owned()],
        warnings,
        merits,
        tables,
        caption: "Measured values, and values computed with the identified machine.".into(),
    }
}

/// Returns texts and tables for the page of a machine that was identified from tables of responses.
pub fn table_words(identified: &IdentifiedResponses) -> Words {
    let summary = identified.summary();
    let (warnings, merits) = verdicts(&summary.checks, &summary.remarks);
    let factors = summary.proportional_damping.iter().flat_map(ProportionalDamping::rows);
    let modes = ("Modes", summary.modes.as_slice());
    let mut tables =
        machine_tables(&summary.parameters, factors.collect(), modes, summary.confidence);
    tables.push(fit_table(&summary.fit, "linear model"));
    if summary.unscaled.is_some() {
        tables.push(shapes(&summary.modes, |at| summary.points[at].clone()));
    }
    let [low, high] =
        [summary.frequencies.first_hz, summary.frequencies.last_hz].map(|hz| compact(hz, 5));
    let (points, forces) = (summary.points.join(", "), summary.forces.join(", "));
    let frequencies = message::count(summary.frequencies.count, "frequency");
    Words {
        what: "Identification",
        files: summary.files.clone(),
        subtitle: vec![
            format!("{} at {points} per force at {forces}", summary.quantity),
            summary.estimator.to_owned(),
            format!("{frequencies}, {low} to {high} Hz"),
        ],
        warnings,
        merits,
        tables,
        caption: "Response per unit force: measured, and of the identified machine.".into(),
    }
}
