//! Measured and fitted receptance.

use mechid_analysis::review::receptance::acts_alone;
use mechid_estimate::frequency_domain::FrequencyData;
use mechid_model::SecondOrderSystem;
use mechid_model::linear_algebra::singular_values;
use mechid_plot::charts::{Quantity, bode};
use mechid_plot::{Axis, Curve, Figure, Panel};
use nalgebra::{Complex, DMatrix, DVector};

use super::trace::Trace;
use crate::ReportError;

/// Points of a fitted curve.
const FINE: usize = 800;

/// Largest condition number of the forces of several experiments by which their responses are separated.
const SEPARABLE: f64 = 100.0;

/// Relative difference of frequencies that are the same line of several records.
const SAME_LINE: f64 = 1e-9;

/// Magnitude and phase of x_i / F_j, measured and fitted, for every pair of degrees of freedom that the
/// records show: on the lines where F_j acts alone, and where as many records as degrees of freedom have
/// independent forces. `None` where no line separates the forces.
///
/// # Errors
/// [`ReportError::Analysis`] if the system has no receptance at a line.
pub fn receptance(
    title: &str,
    data: &FrequencyData,
    system: &SecondOrderSystem,
) -> Result<Option<Figure>, ReportError> {
    let (mut measured, mut fitted) = (Vec::new(), Vec::new());
    let separated = separated(data);
    for j in 0..data.dof() {
        let alone = (0..data.len()).filter(|row| acts_alone(data, *row, j));
        let alone = alone.map(|row| {
            let force = data.force()[(row, j)];
            (data.omega()[row], data.displacement().row(row).transpose() / force)
        });
        let mut points: Vec<Column> = alone.collect();
        points.extend(separated.iter().map(|(omega, h)| (*omega, h.column(j).into_owned())));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let omega: Vec<f64> = points.iter().map(|(omega, _)| *omega).collect();
        let fine = fine_grid(&omega);
        let receptances = system.receptances(&fine)?;
        for i in 0..data.dof().min(points.len()) {
            let name = match data.dof() {
                1 => String::new(),
                _ => format!(" x{}/F{}", i + 1, j + 1),
            };
            let model = fine.iter().zip(&receptances).map(|(omega, h)| (*omega, h[(i, j)]));
            let model = Trace::continuous(format!("identified{name}"), model);
            let points = points.iter().map(|(omega, h)| (*omega, h[i]));
            measured.push(Trace::beside(&model, format!("measured{name}"), points));
            fitted.push(model);
        }
    }
    if measured.is_empty() {
        return Ok(None);
    }
    let [measured, fitted] = [&measured, &fitted]
        .map(|traces| traces.iter().map(Trace::as_response).collect::<Vec<_>>());
    let frequency = Axis::linear("Frequency", "Hz");
    Ok(Some(bode(title, frequency, Quantity::new("Receptance", "m/N"), &measured, &fitted)))
}

/// One column of H at an angular frequency.
type Column = (f64, DVector<Complex<f64>>);

/// H = X F⁻¹ at the frequencies at which as many rows as degrees of freedom have independent forces, of
/// which not each acts alone.
fn separated(data: &FrequencyData) -> Vec<(f64, DMatrix<Complex<f64>>)> {
    let dof = data.dof();
    let mut rows: Vec<usize> = (0..data.len()).collect();
    rows.sort_by(|a, b| data.omega()[*a].total_cmp(&data.omega()[*b]));
    let same = |a: &usize, b: &usize| {
        let [a, b] = [a, b].map(|row| data.omega()[*row]);
        b - a <= SAME_LINE * b
    };
    let mut found = Vec::new();
    for group in rows.chunk_by(same).filter(|group| dof > 1 && group.len() == dof) {
        let is_alone = |row: &usize| (0..dof).any(|j| acts_alone(data, *row, j));
        if group.iter().all(is_alone) {
            continue;
        }
        // Rows are experiments: F Hᵀ = X.
        let force = data.force().select_rows(group);
        let singular = singular_values(force.clone());
        if singular.is_ok_and(|s| s.max() <= SEPARABLE * s.min())
            && let Some(h) = force.lu().solve(&data.displacement().select_rows(group))
        {
            found.push((data.omega()[group[0]], h.transpose()));
        }
    }
    found
}

/// Amplitude of each displacement, measured and predicted from the measured forces.
///
/// # Errors
/// [`ReportError::Analysis`] if the system has no receptance at a line.
pub fn responses(
    title: &str,
    data: &FrequencyData,
    system: &SecondOrderSystem,
) -> Result<Figure, ReportError> {
    let frequency_hz: Vec<f64> =
        data.omega().iter().map(|omega| omega / std::f64::consts::TAU).collect();
    let receptances = system.receptances(data.omega())?;
    let predicted: Vec<DVector<Complex<f64>>> = receptances
        .iter()
        .enumerate()
        .map(|(row, h)| h * data.force().row(row).transpose())
        .collect();
    let mut figure = Figure::new(title);
    for channel in 0..data.dof() {
        // A logarithmic axis shows nothing of no magnitude.
        let points = |label: &str, size: &dyn Fn(usize) -> f64| {
            let shown: Vec<usize> = (0..data.len()).filter(|row| size(*row) > 0.0).collect();
            let x: Vec<f64> = shown.iter().map(|row| frequency_hz[*row]).collect();
            let y: Vec<f64> = shown.iter().map(|row| size(*row)).collect();
            Curve::points(label, &x, &y)
        };
        let y = Axis::log10(format!("Displacement {}", channel + 1), "m");
        figure = figure.panel(
            Panel::new(Axis::linear("Frequency", "Hz"), y)
                .curve(points("measured", &|row| data.displacement()[(row, channel)].norm()))
                .curve(points("predicted", &|row| predicted[row][channel].norm())),
        );
    }
    Ok(figure.share_x())
}

/// Reason for a figure of responses instead of receptances.
pub const WHY: &str = "one record does not separate forces that act at once";

fn fine_grid(omega: &[f64]) -> Vec<f64> {
    let low = omega.iter().copied().fold(f64::INFINITY, f64::min);
    let high = omega.iter().copied().fold(0.0, f64::max);
    if low > high {
        return Vec::new();
    }
    (0..=FINE).map(|k| low + (high - low) * k as f64 / FINE as f64).collect()
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

    /// A record with the force of one shaker and a part of it, turned, at the other place.
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

    /// Judge: (K − ω²M + iωC)⁻¹.
    #[test]
    fn records_with_crosstalk_are_separated_and_one_alone_is_drawn_as_responses() {
        let both = record(0, 0.02).and(&record(1, 0.02)).unwrap();
        let found = separated(&both);
        assert_eq!(found.len(), 20);
        for (omega, h) in found {
            let truth = machine().receptance(omega).unwrap();
            assert!((h - &truth).norm() < 1e-10 * truth.norm(), "{omega}");
        }
        let curves = |data: &FrequencyData| receptance("", data, &machine()).unwrap();
        assert_eq!(curves(&both).expect("two experiments").panels().len(), 2);
        // Forces in a fixed ratio say no more in two records than in one.
        let same = record(0, 0.5).and(&record(0, 0.5)).unwrap();
        for data in [record(0, 0.02), same] {
            assert!(curves(&data).is_none());
            assert_eq!(responses("", &data, &machine()).unwrap().panels().len(), 2);
        }
    }
}
