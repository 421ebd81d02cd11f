//! Comparison of two sets of modes: a structure before and after a change, or a test and a model.

use std::fmt;

use mechid_io::Direction;
use mechid_modal::compare::{self, Difference, Measured, ModePair, PairingRule};
use mechid_modal::indicators::mac;
use mechid_signal::message;
use serde::Serialize;

use super::mode_set::ModeSet;
use crate::AnalysisError;
use crate::limits::MODAL_SIGNIFICANCE;
use crate::text::{paged_table, significant, text_table};

/// Comparison of two sets of modes.
///
/// [`Display`](fmt::Display) writes the result for people, `serde` for programs.
#[derive(Debug, Clone, Serialize)]
pub struct ModeComparison {
    /// Names of the two sets.
    pub sets: [String; 2],
    /// Common points of both sets, by their names in the first set.
    pub points: Vec<String>,
    /// Pairs of corresponding modes of both sets, by rising frequency of the first set.
    pub pairs: Vec<PairRow>,
    /// Modes of the first set without a partner.
    pub only_first: Vec<LoneRow>,
    /// Modes of the second set without a partner.
    pub only_second: Vec<LoneRow>,
    /// Modal assurance criterion of each mode of the first set (rows) with each mode of the second
    /// set (columns), a pure number from 0 to 1.
    pub mac: Vec<Vec<f64>>,
}

/// A pair of modes.
#[derive(Debug, Clone, Serialize)]
pub struct PairRow {
    /// Number of the mode in the first set, from 1.
    pub first: usize,
    /// Number of the mode in the second set, from 1.
    pub second: usize,
    /// Natural frequencies, in Hz.
    pub natural_frequency_hz: DifferenceRow,
    /// Damping ratios, pure numbers; `None` if one set has none.
    pub damping_ratio: Option<DifferenceRow>,
    /// Modal assurance criterion, a pure number.
    pub mac: f64,
    /// Standard error of the modal assurance criterion, a pure number.
    pub mac_standard_error: f64,
    /// Probability of a larger difference of the shapes due to their errors alone, adjusted for the
    /// number of tests; `None` without errors, or at a single point.
    pub shape_p_value: Option<f64>,
}

/// A quantity in both sets, in its unit.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct DifferenceRow {
    /// Value in the first set, in the unit of the quantity.
    pub first: f64,
    /// Value in the second set.
    pub second: f64,
    /// Second value minus first value.
    pub difference: f64,
    /// Standard error of the difference, in the same unit; 0 if both values are exact.
    pub standard_error: f64,
    /// Probability of a larger difference due to the errors alone, adjusted for the number of
    /// tests; `None` if both values are exact.
    pub p_value: Option<f64>,
}

/// A mode without a partner.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct LoneRow {
    /// Number of the mode, from 1.
    pub mode: usize,
    /// Natural frequency, in Hz.
    pub natural_frequency_hz: f64,
}

/// Compares two sets of modes at their common points: pairs by frequency and shape, differences
/// with their standard errors, and modes without a partner.
///
/// Points with the same name are the same. A name without a direction (`3`) matches the only
/// direction of the other set at this point (`3+Z`). Sets without a common name, but with the same
/// number of entries, are compared entry by entry if the names of one set are the numbers from 1.
///
/// # Errors
/// [`AnalysisError::NoCommonPoint`] without a common point.
///
/// # Source
/// As [`mechid_modal::compare::compare`].
pub fn compare_modes(first: &ModeSet, second: &ModeSet) -> Result<ModeComparison, AnalysisError> {
    let common = common_points(first, second)?;
    let one: Vec<(usize, f64)> = common.iter().map(|(i, _, _)| (*i, 1.0)).collect();
    let two: Vec<(usize, f64)> = common.iter().map(|(_, j, sign)| (*j, *sign)).collect();
    let (one, two) = (first.at(&one)?, second.at(&two)?);
    let comparison = compare::compare(&one, &two, PairingRule::default())?;
    let pair = |pair: &ModePair| {
        let (a, b) = (&one[pair.first], &two[pair.second]);
        PairRow {
            first: pair.first + 1,
            second: pair.second + 1,
            natural_frequency_hz: DifferenceRow::new(
                a.natural_frequency_hz,
                b.natural_frequency_hz,
                pair.natural_frequency_hz,
            ),
            damping_ratio: pair.damping_ratio.and_then(|difference| {
                Some(DifferenceRow::new(a.damping_ratio?, b.damping_ratio?, difference))
            }),
            mac: pair.mac.value,
            mac_standard_error: pair.mac.standard_error,
            shape_p_value: pair.shape.map(|test| test.adjusted_p_value),
        }
    };
    let lone = |set: &[compare::ComparedMode], at: &usize| LoneRow {
        mode: at + 1,
        natural_frequency_hz: set[*at].natural_frequency_hz.value,
    };
    let row = |a: &compare::ComparedMode| {
        two.iter().map(|b| mac(a.shape.shape(), b.shape.shape())).collect()
    };
    Ok(ModeComparison {
        sets: [first.name.clone(), second.name.clone()],
        points: common.iter().map(|(i, _, _)| first.points[*i].clone()).collect(),
        pairs: comparison.pairs.iter().map(pair).collect(),
        only_first: comparison.only_first.iter().map(|at| lone(&one, at)).collect(),
        only_second: comparison.only_second.iter().map(|at| lone(&two, at)).collect(),
        mac: one.iter().map(row).collect(),
    })
}

/// Returns the indices of the corresponding entries of both sets, and the sign that multiplies the
/// entry of the second set.
fn common_points(
    first: &ModeSet,
    second: &ModeSet,
) -> Result<Vec<(usize, usize, f64)>, AnalysisError> {
    let partner = |name: &String| {
        second.points.iter().position(|other| other == name).map(|at| (at, 1.0)).or_else(|| {
            let directions = |at: &usize| same_direction(name, &second.points[*at]);
            let mut some = (0..second.points.len()).filter_map(|at| Some((at, directions(&at)?)));
            // A name without a direction is ambiguous if the other set has several directions at
            // this point.
            some.next().filter(|_| some.next().is_none())
        })
    };
    let names = first.points.iter().enumerate();
    let common: Vec<_> =
        names.filter_map(|(i, name)| partner(name).map(|(j, sign)| (i, j, sign))).collect();
    let numbered = |set: &ModeSet| {
        set.points.iter().enumerate().all(|(at, name)| *name == (at + 1).to_string())
    };
    let len = first.points.len();
    if common.is_empty() && len == second.points.len() && (numbered(first) || numbered(second)) {
        return Ok((0..len).map(|at| (at, at, 1.0)).collect());
    }
    if common.is_empty() {
        let list = |set: &ModeSet| message::list(&set.points, ", ", LISTED);
        return Err(AnalysisError::NoCommonPoint {
            first: first.name.clone(),
            points: list(first),
            second: second.name.clone(),
            other_points: list(second),
        });
    }
    Ok(common)
}

/// Maximum number of points in a message.
const LISTED: usize = 6;

/// Returns 1 if two names can be the same point and direction, and −1 if the directions are
/// opposite; otherwise `None`.
fn same_direction(one: &str, other: &str) -> Option<f64> {
    let undirected = |directed: &str, point: &str| {
        let direction = Direction::parse(directed).filter(|one| one.point == point)?;
        Some(if direction.is_negative { -1.0 } else { 1.0 })
    };
    Direction::relative_sign(one, other)
        .or_else(|| undirected(one, other))
        .or_else(|| undirected(other, one))
}

impl DifferenceRow {
    fn new(first: Measured, second: Measured, difference: Difference) -> Self {
        Self {
            first: first.value,
            second: second.value,
            difference: difference.value,
            standard_error: difference.standard_error,
            p_value: difference.adjusted_p_value,
        }
    }

    /// Returns the cells of a row, with all values multiplied by a factor.
    fn cells(&self, factor: f64, digits: usize) -> Vec<String> {
        let number = |value: f64, digits| significant(factor * value, digits);
        let mut cells = vec![number(self.first, digits), number(self.second, digits)];
        cells.push(number(self.difference, 3));
        let dash = || "–".to_owned();
        let is_exact = self.standard_error == 0.0;
        cells.push(if is_exact { dash() } else { number(self.standard_error, 2) });
        cells.push(self.p_value.map_or_else(dash, |p| significant(p, 2)));
        cells
    }

    fn has_changed(&self) -> bool {
        self.p_value.is_some_and(|p| p < MODAL_SIGNIFICANCE)
    }
}

impl PairRow {
    fn name(&self) -> String {
        format!("{} – {}", self.first, self.second)
    }

    /// Returns the names of the quantities with a significant difference.
    fn changes(&self) -> Vec<&'static str> {
        let mut changes = Vec::new();
        if self.natural_frequency_hz.has_changed() {
            changes.push("frequency");
        }
        if self.damping_ratio.as_ref().is_some_and(DifferenceRow::has_changed) {
            changes.push("damping");
        }
        if self.shape_p_value.is_some_and(|p| p < MODAL_SIGNIFICANCE) {
            changes.push("shape");
        }
        changes
    }
}

impl ModeComparison {
    fn pair_table(
        &self,
        header: [&str; 6],
        cells: impl Fn(&PairRow) -> Option<Vec<String>>,
    ) -> String {
        let mut rows = vec![header.map(String::from).to_vec()];
        for pair in &self.pairs {
            rows.extend(cells(pair).map(|cells| [vec![pair.name()], cells].concat()));
        }
        if rows.len() > 1 { format!("\n{}", text_table(&rows)) } else { String::new() }
    }

    fn shape_table(&self) -> String {
        let mut rows = vec![["modes", "MAC", "±", "p"].map(String::from).to_vec()];
        for pair in &self.pairs {
            let p = pair.shape_p_value.map_or("–".into(), |p| significant(p, 2));
            let error = match pair.mac_standard_error {
                0.0 => "–".into(),
                error => significant(error, 2),
            };
            rows.push(vec![pair.name(), format!("{:.5}", pair.mac), error, p]);
        }
        if rows.len() > 1 { format!("\n{}", text_table(&rows)) } else { String::new() }
    }

    fn mac_table(&self) -> String {
        let columns = self.mac.first().map_or(0, Vec::len);
        let header = std::iter::once("MAC".to_owned()).chain((1..=columns).map(|n| n.to_string()));
        let mut rows = vec![header.collect::<Vec<_>>()];
        for (number, values) in (1..).zip(&self.mac) {
            let cells = values.iter().map(|value| format!("{value:.3}"));
            rows.push(std::iter::once(number.to_string()).chain(cells).collect());
        }
        format!("\n{}", paged_table(&rows, 1))
    }
}

impl ModeComparison {
    /// Returns remarks about changed modes, modes without a partner, and a comparison at one point.
    fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        for pair in self.pairs.iter().filter(|pair| !pair.changes().is_empty()) {
            remarks.push(format!("modes {}: different {}", pair.name(), pair.changes().join(", ")));
        }
        for (rows, which) in [(&self.only_first, "first"), (&self.only_second, "second")] {
            remarks.extend(rows.iter().map(|LoneRow { mode, natural_frequency_hz }| {
                let hz = significant(*natural_frequency_hz, 5);
                format!("only in the {which} set: mode {mode}, {hz} Hz")
            }));
        }
        if self.points.len() == 1 {
            let why = "note: with a single common point shapes cannot be compared; the modes are paired by frequency alone";
            remarks.push(why.into());
        }
        remarks
    }
}

impl fmt::Display for ModeComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [first, second] = &self.sets;
        writeln!(f, "first: {first}\nsecond: {second}")?;
        let points = message::count(self.points.len(), "point");
        writeln!(
            f,
            "{points} in common; p is adjusted for the number of tests; ± is one standard error"
        )?;
        let frequencies = ["frequency (Hz)", "first", "second", "difference", "±", "p"];
        f.write_str(
            &self.pair_table(frequencies, |pair| Some(pair.natural_frequency_hz.cells(1.0, 6))),
        )?;
        let dampings = ["damping (%)", "first", "second", "difference", "±", "p"];
        f.write_str(&self.pair_table(dampings, |pair| Some(pair.damping_ratio?.cells(100.0, 4))))?;
        if self.points.len() > 1 {
            f.write_str(&self.shape_table())?;
            f.write_str(&self.mac_table())?;
        }
        let remarks = self.remarks();
        if remarks.is_empty() { Ok(()) } else { writeln!(f, "\n{}", remarks.join("\n")) }
    }
}
