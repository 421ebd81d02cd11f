//! Measured and fitted receptance.

use std::slice::from_ref;

use mechid_analysis::identify::ResponseCoherence;
use mechid_analysis::review::receptance::ActingAlone;
use mechid_model::SecondOrderSystem;
use mechid_numerics::linear_algebra::singular_values;
use mechid_plot::charts::Quantity;
use mechid_plot::{Axis, Curve, Figure, Panel, ROUNDING};
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix, DVector};

use super::style::{FigureStyle, FrequencyScale, MagnitudeScale, derivative, per_force};
use super::trace::Trace;
use crate::ReportError;

/// Names of displacements and forces, by their degree of freedom counted from 0.
#[derive(Clone, Copy)]
pub struct Names<'a> {
    /// Returns the name of a displacement.
    pub displacement: &'a dyn Fn(usize) -> String,
    /// Returns the name of a force.
    pub force: &'a dyn Fn(usize) -> String,
}

impl Names<'_> {
    /// Returns the name of a receptance.
    pub(super) fn pair(&self, motion: usize, force: usize) -> String {
        format!("{} / {}", (self.displacement)(motion), (self.force)(force))
    }
}

/// Number of points of a fitted curve.
const FINE: usize = 800;

/// Maximum condition number of the matrix of forces of several experiments; above it, the responses
/// to the forces are not separated.
const SEPARABLE: f64 = 100.0;

/// Maximum relative difference between frequencies of several records that count as the same line.
const SAME_LINE: f64 = 1e-9;

/// Maximum number of degrees of freedom for which each pair of response and force has separate
/// panels.
const GRID: usize = 8;

/// Returns magnitude and phase of the response per unit force x_i / F_j, measured and fitted, in
/// the quantity of the style or, if the style has none, in the measured quantity. Only the pairs
/// that the records determine are shown, from two kinds of lines: lines where F_j acts alone, and
/// lines where as many records as degrees of freedom have independent forces. `None` if the
/// responses to the forces cannot be separated at any line.
///
/// The panels form a matrix, with a row for each response and a column for each force; with more
/// than eight degrees of freedom all pairs are drawn together.
///
/// # Errors
/// [`ReportError::Analysis`] if the system has no receptance at a line.
pub fn receptance(
    title: &str,
    data: &FrequencyData,
    system: &SecondOrderSystem,
    names: Names<'_>,
    style: FigureStyle,
) -> Result<Option<Figure>, ReportError> {
    let Some(pairs) = pairs(data, system, names, style)? else { return Ok(None) };
    let quantity = per_force(style.quantity.unwrap_or(data.measured()));
    let usual = FrequencyScale::Linear;
    let dof = data.dof();
    if !(2..=GRID).contains(&dof) {
        let named = |pair: Pair| {
            let name = if dof == 1 { String::new() } else { format!(" {}", pair.name) };
            (pair.measured.suffixed(&name), pair.fitted.suffixed(&name))
        };
        let (measured, fitted): (Vec<Trace>, Vec<Trace>) = pairs.into_iter().map(named).unzip();
        return Ok(Some(style.chart(title, usual, quantity, [&measured, &fitted])));
    }
    let mut figure = Figure::new(title);
    let columns = pairs.iter().filter(|pair| pair.motion == 0).count();
    for row in pairs.chunk_by(|a, b| a.motion == b.motion) {
        let charts: Vec<Figure> = row
            .iter()
            .map(|Pair { measured, fitted, .. }| {
                style.chart("", usual, quantity, [from_ref(measured), from_ref(fitted)])
            })
            .collect();
        for at in 0..2 {
            for (chart, pair) in charts.iter().zip(row) {
                let panel = chart.panels()[at].clone();
                figure = figure.panel(if at == 0 { panel.title(pair.name.clone()) } else { panel });
            }
        }
    }
    Ok(Some(figure.columns(columns).share_x().shared_legend()))
}

/// Maximum number of pairs of response and force that a page draws.
pub const DRAWN_PAIRS: usize = 128;

/// Returns a separate figure for each pair of response and force whose receptance is not zero, at
/// most [`DRAWN_PAIRS`] figures. Below the curves, a figure shows the coherence of the response, if
/// this coherence is known. `None` if the responses to the forces cannot be separated at any line.
///
/// # Errors
/// As [`receptance`].
pub fn receptance_set(
    data: &FrequencyData,
    system: &SecondOrderSystem,
    names: Names<'_>,
    style: FigureStyle,
    measured: Option<&ResponseCoherence>,
) -> Result<Option<Vec<(String, Figure)>>, ReportError> {
    let Some(mut pairs) = pairs(data, system, names, style)? else { return Ok(None) };
    let size = |pair: &Pair| pair.measured.largest(style).max(pair.fitted.largest(style));
    let largest = pairs.iter().map(size).fold(0.0, f64::max);
    pairs.retain(|pair| size(pair) > ROUNDING * largest);
    let quantity = per_force(style.quantity.unwrap_or(data.measured()));
    let draw = |pair: Pair| {
        let Pair { motion, name, measured: points, fitted, .. } = pair;
        let curves = [from_ref(&points), from_ref(&fitted)];
        let figure = style.chart("", FrequencyScale::Linear, quantity, curves);
        let figure = match measured {
            Some(measured) => figure.panel(coherence_of(measured, motion, style)),
            None => figure,
        };
        (name, figure)
    };
    Ok(Some(pairs.into_iter().take(DRAWN_PAIRS).map(draw).collect()))
}

/// Response per unit force, measured and fitted.
struct Pair {
    motion: usize,
    name: String,
    measured: Trace,
    fitted: Trace,
}

/// Returns the pairs of response and force that the records determine, sorted by response; `None`
/// if there are none.
fn pairs(
    data: &FrequencyData,
    system: &SecondOrderSystem,
    names: Names<'_>,
    style: FigureStyle,
) -> Result<Option<Vec<Pair>>, ReportError> {
    let dof = data.dof();
    let quantity = style.quantity.unwrap_or(data.measured());
    let forces: Vec<Vec<Column>> = columns(data);
    let shown: Vec<usize> = (0..dof).filter(|j| !forces[*j].is_empty()).collect();
    if shown.is_empty() {
        return Ok(None);
    }
    let mut pairs = Vec::new();
    for &j in &shown {
        let points = &forces[j];
        let omega: Vec<f64> = points.iter().map(|(omega, _)| *omega).collect();
        let fine = fine_grid(&omega, dof * shown.len());
        let receptances = system.receptances(&fine)?;
        for i in 0..dof {
            let of = |omega: f64, h: Complex<f64>| (omega, h * derivative(quantity, omega));
            let model = fine.iter().zip(&receptances).map(|(omega, h)| of(*omega, h[(i, j)]));
            let fitted = Trace::line(style, "identified".into(), model);
            let points = points.iter().map(|(omega, h)| of(*omega, h[i]));
            let measured = Trace::beside(style, &fitted, "measured".into(), points);
            pairs.push(Pair { motion: i, name: names.pair(i, j), measured, fitted });
        }
    }
    // The sort is stable: the forces of a response keep their order.
    pairs.sort_by_key(|pair| pair.motion);
    Ok(Some(pairs))
}

/// Returns the measured columns of H for each force, in rising order of frequency.
fn columns(data: &FrequencyData) -> Vec<Vec<Column>> {
    let acting = ActingAlone::new(data);
    let separated = separated(data, &acting);
    let of_force = |j: usize| {
        let alone = (0..data.len()).filter(|row| acting.on(*row, j));
        let alone = alone.map(|row| {
            let force = data.force()[(row, j)];
            (data.omega()[row], data.displacement().row(row).transpose() / force)
        });
        let mut points: Vec<Column> = alone.collect();
        points.extend(separated.iter().map(|(omega, h)| (*omega, h.column(j).into_owned())));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    (0..data.dof()).map(of_force).collect()
}

/// One column of H, with its angular frequency.
type Column = (f64, DVector<Complex<f64>>);

/// Returns H = X F⁻¹ at each frequency for which the number of rows equals the number of degrees of
/// freedom and the forces of these rows are independent. Frequencies at which only one force acts
/// in each row are omitted.
fn separated(data: &FrequencyData, acting: &ActingAlone<'_>) -> Vec<(f64, DMatrix<Complex<f64>>)> {
    let dof = data.dof();
    let mut rows: Vec<usize> = (0..data.len()).collect();
    rows.sort_by(|a, b| data.omega()[*a].total_cmp(&data.omega()[*b]));
    let same = |a: &usize, b: &usize| {
        let [a, b] = [a, b].map(|row| data.omega()[*row]);
        b - a <= SAME_LINE * b
    };
    let mut receptances = Vec::new();
    for group in rows.chunk_by(same).filter(|group| dof > 1 && group.len() == dof) {
        let is_alone = |row: &usize| (0..dof).any(|j| acting.on(*row, j));
        if group.iter().all(is_alone) {
            continue;
        }
        // Rows are experiments, so the equation is F Hᵀ = X.
        let force = data.force().select_rows(group);
        let singular = singular_values(force.clone());
        if singular.is_ok_and(|s| s.max() <= SEPARABLE * s.min())
            && let Some(h) = force.lu().solve(&data.displacement().select_rows(group))
        {
            receptances.push((data.omega()[group[0]], h.transpose()));
        }
    }
    receptances
}

/// Returns the amplitude of each displacement, measured and predicted from the measured forces.
///
/// # Errors
/// [`ReportError::Analysis`] if the system has no receptance at a line.
pub fn responses(
    title: &str,
    data: &FrequencyData,
    system: &SecondOrderSystem,
    names: Names<'_>,
    style: FigureStyle,
) -> Result<Figure, ReportError> {
    let frequency_hz: Vec<f64> =
        data.omega().iter().map(|omega| omega / std::f64::consts::TAU).collect();
    let receptances = system.receptances(data.omega())?;
    let mut predicted = DMatrix::zeros(data.len(), data.dof());
    for (row, h) in receptances.iter().enumerate() {
        let response = h * data.force().row(row).transpose();
        predicted.row_mut(row).tr_copy_from(&response);
    }
    let mut figure = Figure::new(title);
    for channel in 0..data.dof() {
        // A logarithmic axis cannot show zero.
        let points = |label: &str, size: &dyn Fn(usize) -> f64| {
            let shown: Vec<usize> = (0..data.len()).filter(|row| size(*row) > 0.0).collect();
            let x: Vec<f64> = shown.iter().map(|row| frequency_hz[*row]).collect();
            let scaled = |size: f64| match style.magnitude {
                MagnitudeScale::Logarithmic => size,
                MagnitudeScale::Decibel => 20.0 * size.log10(),
            };
            let y: Vec<f64> = shown.iter().map(|row| scaled(size(*row))).collect();
            Curve::points(label, &x, &y)
        };
        let name = (names.displacement)(channel);
        let y = style.magnitude_axis(Quantity::new(&name, "m"));
        figure = figure.panel(
            Panel::new(style.frequency_axis(FrequencyScale::Linear), y)
                .curve(points("measured", &|row| data.displacement()[(row, channel)].norm()))
                .curve(points("predicted", &|row| predicted[(row, channel)].norm())),
        );
    }
    Ok(figure.share_x())
}

/// Returns the coherence of each response with all forces; `name` returns the name of a response.
pub fn coherence(
    measured: &ResponseCoherence,
    name: &dyn Fn(usize) -> String,
    style: FigureStyle,
) -> Panel {
    let axis = style.frequency_axis(FrequencyScale::Linear);
    let mut panel = Panel::new(axis, Axis::linear("Coherence", "").range(0.0, 1.05));
    // A logarithmic axis cannot show 0 Hz.
    let hidden = measured.frequency_hz.iter().take_while(|hz| **hz <= 0.0).count();
    let motions = measured.values.ncols();
    for (at, values) in measured.values.column_iter().enumerate() {
        let name = if motions == 1 { String::new() } else { name(at) };
        let values: Vec<f64> = values.iter().skip(hidden).copied().collect();
        panel = panel.curve(Curve::line(name, &measured.frequency_hz[hidden..], &values));
    }
    panel
}

/// Returns the coherence of one response with all forces.
fn coherence_of(measured: &ResponseCoherence, motion: usize, style: FigureStyle) -> Panel {
    let axis = style.frequency_axis(FrequencyScale::Linear);
    let hidden = measured.frequency_hz.iter().take_while(|hz| **hz <= 0.0).count();
    let at = motion.min(measured.values.ncols().saturating_sub(1));
    let values: Vec<f64> = measured.values.column(at).iter().skip(hidden).copied().collect();
    Panel::new(axis, Axis::linear("Coherence", "").range(0.0, 1.05)).curve(Curve::line(
        "",
        &measured.frequency_hz[hidden..],
        &values,
    ))
}

/// Note on a figure that shows responses instead of receptances.
pub const WHY: &str = "a single record does not separate forces that act at the same time";

/// Returns the frequencies of a fitted curve, fewer of them if there are many curves.
fn fine_grid(omega: &[f64], curves: usize) -> Vec<f64> {
    let points = (FINE * 16 / curves.max(16)).max(FINE / 4);
    let low = omega.iter().copied().fold(f64::INFINITY, f64::min);
    let high = omega.iter().copied().fold(0.0, f64::max);
    if low > high {
        return Vec::new();
    }
    (0..=points).map(|k| low + (high - low) * k as f64 / points as f64).collect()
}

#[cfg(test)]
mod tests {
    use mechid_model::ResponseQuantity;
    use nalgebra::dmatrix;

    use super::*;

    fn machine() -> SecondOrderSystem {
        SecondOrderSystem::new(
            dmatrix![2.0, 0.0; 0.0, 3.0],
            dmatrix![4.0, -1.0; -1.0, 3.0],
            dmatrix![9000.0, -4000.0; -4000.0, 6000.0],
        )
        .unwrap()
    }

    /// Returns the record of a test in which one shaker acts on the degree of freedom `driven`. The
    /// fraction `crosstalk` of its force acts, with another phase, on the other degree of freedom.
    fn record(driven: usize, crosstalk: f64) -> FrequencyData {
        let omega: Vec<f64> = (1..=20).map(|line| f64::from(line) * 5.0).collect();
        let force = DMatrix::from_fn(omega.len(), 2, |row, dof| {
            let part = if dof == driven { 1.0 } else { crosstalk };
            Complex::from_polar(part, 0.7 * (row * (dof + 1)) as f64)
        });
        let receptances = machine().receptances(&omega).unwrap();
        let motion = DMatrix::from_fn(omega.len(), 2, |row, dof| {
            (&receptances[row] * force.row(row).transpose())[dof]
        });
        FrequencyData::from_amplitudes(omega, force, motion, ResponseQuantity::Displacement)
            .unwrap()
    }

    /// The receptances separated from two records with crosstalk must equal (K − ω²M + iωC)⁻¹; a
    /// single record with crosstalk has no receptances and is drawn as responses.
    #[test]
    fn records_with_crosstalk_are_separated_and_one_alone_is_drawn_as_responses() {
        let both = record(0, 0.02).and(&record(1, 0.02)).unwrap();
        let found = separated(&both, &ActingAlone::new(&both));
        assert_eq!(found.len(), 20);
        for (omega, h) in found {
            let truth = machine().receptance(omega).unwrap();
            assert!((h - &truth).norm() < 1e-10 * truth.norm(), "{omega}");
        }
        let style = FigureStyle::default();
        let names = Names {
            displacement: &|dof| format!("x{}", dof + 1),
            force: &|dof| format!("F{}", dof + 1),
        };
        let curves = |data: &FrequencyData| receptance("", data, &machine(), names, style).unwrap();
        let drawn = curves(&both).expect("two experiments");
        let titles: Vec<&str> = drawn.panels().iter().map(Panel::name).collect();
        assert_eq!(titles, ["x1 / F1", "x1 / F2", "", "", "x2 / F1", "x2 / F2", "", ""]);
        let drawn = curves(&record(1, 0.0)).expect("one force acts alone");
        let titles: Vec<&str> = drawn.panels().iter().map(Panel::name).collect();
        assert_eq!(titles, ["x1 / F2", "", "x2 / F2", ""]);
        // Forces in a fixed ratio give no more information in two records than in one.
        let same = record(0, 0.5).and(&record(0, 0.5)).unwrap();
        for data in [record(0, 0.02), same] {
            assert!(curves(&data).is_none());
            assert_eq!(responses("", &data, &machine(), names, style).unwrap().panels().len(), 2);
        }
    }

    #[test]
    fn a_pair_whose_response_is_rounding_is_left_out() {
        let alone = SecondOrderSystem::new(
            dmatrix![2.0, 0.0; 0.0, 3.0],
            dmatrix![4.0, 1e-15; 1e-15, 3.0],
            dmatrix![9000.0, 1e-12; 1e-12, 6000.0],
        )
        .unwrap();
        let driven = record(1, 0.0);
        let motion = DMatrix::from_fn(driven.len(), 2, |row, dof| {
            let h = alone.receptance(driven.omega()[row]).unwrap();
            (h * driven.force().row(row).transpose())[dof]
        });
        let (omega, force) = (driven.omega().to_vec(), driven.force().clone());
        let kind = ResponseQuantity::Displacement;
        let data = FrequencyData::from_amplitudes(omega, force, motion, kind).unwrap();
        let names = Names {
            displacement: &|dof| format!("x{}", dof + 1),
            force: &|dof| format!("F{}", dof + 1),
        };
        let set = receptance_set(&data, &alone, names, FigureStyle::default(), None);
        let set = set.unwrap().expect("one force acts alone");
        let drawn: Vec<&str> = set.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(drawn, ["x2 / F2"]);
    }
}
