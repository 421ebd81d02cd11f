//! Result of the identification of a machine as text.

use std::fmt;

use mechid_estimate::likelihood::{IntervalKind, ParameterEstimate};
use mechid_signal::message;

use super::data::{TestKind, TestRow};
use super::summary::{CandidateRow, ElementRow, ElementSummary};
use crate::hits;
use crate::identify::checks::CheckRow;
use crate::identify::rows::{ModeRow, Uncertain};
use crate::text::{compact, paragraph, significant, text_table};

/// Number of digits of the limits of an interval.
const INTERVAL_DIGITS: usize = 5;

impl fmt::Display for ElementSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}\n{}", self.heading(), self.parameter_table())?;
        f.write_str(&paragraph(self.combinations.iter().map(|row| row.text.clone())))?;
        write!(f, "\n{}", self.sensor_table())?;
        f.write_str(&self.mode_table())?;
        if !self.candidates.is_empty() {
            write!(f, "\n{}", self.candidate_table())?;
        }
        write!(f, "\n{}\n{}", self.search(), self.check_lines())?;
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))
    }
}

impl ElementSummary {
    fn heading(&self) -> String {
        let mut text = match self.tests.iter().find_map(|test| test.window.as_ref()) {
            Some(window) if !self.hits.is_empty() => {
                hits::heading(&self.hits, &compact(window.sample_rate_hz, 6))
            }
            _ => {
                self.tests.iter().map(|test| format!("{}: {}\n", test.file, test.words())).collect()
            }
        };
        let [low, high] = self.band_hz.map(|hz| compact(hz, 5));
        text += &format!(
            "{}, {}, {}; maximum likelihood, {}, {low} to {high} Hz; ± is one standard error\n",
            message::count(self.points.len(), "degree of freedom"),
            message::count(self.inputs.len(), "input"),
            message::count(self.sensors.len(), "sensor"),
            message::count(self.lines, "line"),
        );
        text + &format!("noise: {}\n", self.noise)
    }

    fn parameter_table(&self) -> String {
        let percent = compact(100.0 * self.confidence, 4);
        let with_priors = self.parameters.iter().any(|row| row.estimate.prior.is_some());
        let mut header =
            vec!["parameter".into(), "value".into(), "±".into(), format!("{percent} % interval")];
        if with_priors {
            header.push("from the prior (%)".into());
        }
        let mut rows = vec![header];
        for row in &self.parameters {
            let (unit, estimate) = (row.unit, &row.estimate);
            let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
            let name = format!("{}{unit}", estimate.name);
            let [value, error, interval] = row.cells();
            let mut row = vec![name, value, error, interval];
            if with_priors {
                let share = estimate.prior.map(|prior| significant(100.0 * prior.share, 3));
                row.push(share.unwrap_or_default());
            }
            rows.push(row);
        }
        text_table(&rows)
    }

    fn sensor_table(&self) -> String {
        let mut rows = vec![vec!["sensor".to_owned(), "residual (% of RMS)".to_owned()]];
        rows.extend(self.sensors.iter().map(|sensor| {
            vec![sensor.name.clone(), significant(100.0 * sensor.relative_residual, 3)]
        }));
        text_table(&rows)
    }

    /// Returns the modes up to the highest frequency of the data, after an empty line. The text is
    /// empty if there are no modes.
    fn mode_table(&self) -> String {
        let header = ["mode", "value", "±"].map(String::from).to_vec();
        let mut rows = vec![header];
        let in_band = |mode: &&ModeRow| mode.natural_frequency_hz.value <= self.band_hz[1];
        let modes: Vec<ModeRow> = self.modes.iter().take_while(in_band).cloned().collect();
        for (name, value, unit) in ModeRow::quantities(&modes, false) {
            let [value, error, _] = value.cells();
            rows.push(vec![format!("{name} ({unit})"), value, error]);
        }
        if rows.len() == 1 { String::new() } else { format!("\n{}", text_table(&rows)) }
    }

    fn candidate_table(&self) -> String {
        let header = ["to add", "information", "newly determined", "mean reduction of ± (%)"];
        let mut rows = vec![header.map(String::from).to_vec()];
        for row in &self.candidates {
            let gain = row.information_gain.map_or("∞".into(), |gain| significant(gain, 3));
            let mut cells = vec![row.name.clone(), gain, row.newly_determined.to_string()];
            cells.push(self.reduction(row).map_or("–".into(), |share| significant(share, 3)));
            rows.push(cells);
        }
        text_table(&rows)
    }

    /// Returns the reduction of the standard errors by a candidate measurement, averaged over the
    /// determined parameters, in per cent.
    ///
    /// # Source
    /// Arithmetic mean of the relative reductions.
    pub fn reduction(&self, row: &CandidateRow) -> Option<f64> {
        let pairs = self.parameters.iter().zip(&row.standard_errors);
        let reductions: Vec<f64> = pairs
            .filter_map(|(parameter, after)| {
                let scale = self.error_scale;
                Some(1.0 - (*after)? * scale / parameter.estimate.standard_error?)
            })
            .collect();
        let count = reductions.len();
        (count > 0).then(|| 100.0 * reductions.iter().sum::<f64>() / count as f64)
    }

    fn search(&self) -> String {
        let Some((best, others)) = self.minima.split_first() else { return String::new() };
        let searches = if self.searches == 1 { "search" } else { "searches" };
        let text = format!(
            "{} of {} {searches} ended at the highest likelihood (ln L = {})",
            best.searches,
            self.searches,
            significant(self.log_likelihood, 6)
        );
        let describe = |end: &mechid_estimate::likelihood::FoundMinimum| {
            let below = 0.5 * (end.sum_of_squares - best.sum_of_squares);
            format!("{} at ln L lower by {}", end.searches, significant(below, 3))
        };
        let descriptions: Vec<String> = others.iter().map(describe).collect();
        if descriptions.is_empty() {
            text + "\n"
        } else {
            format!("{text}; {}\n", descriptions.join(", "))
        }
    }

    fn check_lines(&self) -> String {
        let warnings: Vec<&CheckRow> = self.checks.iter().filter(|c| c.is_conspicuous()).collect();
        let passed = self.checks.len() - warnings.len();
        let mut text =
            format!("{passed} of {} passed\n", message::count(self.checks.len(), "check"));
        for check in warnings {
            text += &format!("  warning: {}\n", check.sentence());
        }
        text
    }
}

impl TestRow {
    /// Returns a text that names the samples or lines of the file that are used.
    pub fn words(&self) -> String {
        let samples = self.window.as_ref().map(|window| {
            let rate = compact(window.sample_rate_hz, 6);
            let (first, last) = (window.first_sample, window.last_sample);
            match self.kind {
                TestKind::Periods => format!(
                    "samples {first} to {last}, {} of {}, {rate} Hz",
                    message::count(window.periods, "period"),
                    window.period_samples
                ),
                _ => format!("samples {first} to {last}, {rate} Hz, an open record"),
            }
        });
        samples.unwrap_or_else(|| match self.kind {
            TestKind::Speeds => "synchronous responses over the speed".into(),
            _ => "frequency responses".into(),
        })
    }
}

impl ElementRow {
    /// Returns value, standard error and interval; the error decides the number of digits.
    pub fn cells(&self) -> [String; 3] {
        cells(&self.estimate)
    }
}

/// Returns value, standard error and interval, with digits that depend on the error.
fn cells(estimate: &ParameterEstimate) -> [String; 3] {
    let end = |value: f64| compact(value, INTERVAL_DIGITS);
    let [low, high] = estimate.interval;
    let interval = match estimate.interval_kind {
        IntervalKind::Open => "open".into(),
        IntervalKind::OneSided => format!("{} … {}, one-sided", end(low), end(high)),
        IntervalKind::Wald | IntervalKind::Profile => format!("{} … {}", end(low), end(high)),
    };
    match estimate.standard_error {
        None => [significant(estimate.value, INTERVAL_DIGITS), "–".into(), interval],
        Some(error) => {
            let [value, error, of_digits] =
                Uncertain::new(estimate.value, error, estimate.interval).cells();
            let is_wald = estimate.interval_kind == IntervalKind::Wald;
            [value, error, if is_wald { of_digits } else { interval }]
        }
    }
}
