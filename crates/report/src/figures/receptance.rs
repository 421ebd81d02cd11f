//! Measured and fitted receptance.

use mechid_analysis::review::receptance::acts_alone;
use mechid_estimate::frequency_domain::FrequencyData;
use mechid_model::SecondOrderSystem;
use mechid_plot::charts::{Quantity, bode};
use mechid_plot::{Axis, Figure};

use super::trace::Trace;
use crate::ReportError;

/// Points of a fitted curve.
const FINE: usize = 800;

/// Magnitude and phase of x_i / F_j, measured and fitted, for every pair of degrees of freedom that
/// the record shows: on the lines where F_j acts alone.
///
/// # Errors
/// [`ReportError::NoReceptance`] if on every line several forces act at once.
pub fn receptance(
    title: &str,
    data: &FrequencyData,
    system: &SecondOrderSystem,
) -> Result<Figure, ReportError> {
    let (mut measured, mut fitted) = (Vec::new(), Vec::new());
    for j in 0..data.dof() {
        let rows: Vec<usize> = (0..data.len()).filter(|row| acts_alone(data, *row, j)).collect();
        let omega: Vec<f64> = rows.iter().map(|row| data.omega()[*row]).collect();
        let fine = fine_grid(&omega);
        let receptances = system.receptances(&fine)?;
        for i in 0..data.dof().min(rows.len()) {
            let name = match data.dof() {
                1 => String::new(),
                _ => format!(" x{}/F{}", i + 1, j + 1),
            };
            let model = fine.iter().zip(&receptances).map(|(omega, h)| (*omega, h[(i, j)]));
            let model = Trace::continuous(format!("identified{name}"), model);
            let ratio = |row: usize| data.displacement()[(row, i)] / data.force()[(row, j)];
            let points = omega.iter().zip(&rows).map(|(omega, row)| (*omega, ratio(*row)));
            measured.push(Trace::beside(&model, format!("measured{name}"), points));
            fitted.push(model);
        }
    }
    if measured.is_empty() {
        return Err(ReportError::NoReceptance);
    }
    let [measured, fitted] = [&measured, &fitted]
        .map(|traces| traces.iter().map(Trace::as_response).collect::<Vec<_>>());
    let frequency = Axis::linear("Frequency", "Hz");
    Ok(bode(title, frequency, Quantity::new("Receptance", "m/N"), &measured, &fitted))
}

fn fine_grid(omega: &[f64]) -> Vec<f64> {
    let low = omega.iter().copied().fold(f64::INFINITY, f64::min);
    let high = omega.iter().copied().fold(0.0, f64::max);
    if low > high {
        return Vec::new();
    }
    (0..=FINE).map(|k| low + (high - low) * k as f64 / FINE as f64).collect()
}
