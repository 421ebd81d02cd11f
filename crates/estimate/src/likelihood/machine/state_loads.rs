//! Loads on a machine from the difference between its initial and its final state in an open
//! record.

use mechid_model::elements::Assembly;
use mechid_numerics::linear_algebra::hermitian_eigen;
use nalgebra::{DMatrix, DVector};

use super::LikelihoodError;
use super::nominal::{Nominal, Places};
use crate::likelihood::limits::{EACH_STATE_DOFS, MOST_STATES, STATE_LINES, STATE_RESPONSE};

/// Returns the state loads, n rows with one column for each load. Their span contains all loads M
/// (s Δx + Δv) + C Δx to which the sensors respond; Δx and Δv are the differences between the
/// initial and the final displacement and velocity of a record.
///
/// In a small machine, or in one with a measured part, the state loads are unit loads on all
/// degrees of freedom. In a large machine they are the directions of loads to which sensors and
/// joints of the nominal machine respond at the frequencies of the data. For any values of the
/// unknowns the response S H of the sensors is a combination of these responses, because the
/// unknown terms act at the joints.
///
/// # Errors
/// [`LikelihoodError::NoResponse`] if the nominal machine is singular,
/// [`LikelihoodError::LargeOpen`] for more than [`MOST_STATES`] loads.
///
/// # Source
/// Ours; the reduction is that of snapshots by proper orthogonal decomposition, Sirovich (1987),
/// Quarterly of Applied Mathematics 45, 561–571.
pub(super) fn state_loads(
    nominal: &Nominal<'_>,
    assembly: &Assembly,
    places: &Places,
    omega: &[f64],
) -> Result<DMatrix<f64>, LikelihoodError> {
    let n = assembly.dof();
    let loads = if n <= EACH_STATE_DOFS || !assembly.measured().is_empty() {
        DMatrix::identity(n, n)
    } else {
        responding(nominal, assembly, places, omega)?
    };
    match loads.ncols() {
        got if got > MOST_STATES => Err(LikelihoodError::LargeOpen { got, most: MOST_STATES }),
        _ => Ok(loads),
    }
}

/// Returns the directions of loads to which sensors and joints of the nominal machine respond.
fn responding(
    nominal: &Nominal<'_>,
    assembly: &Assembly,
    places: &Places,
    omega: &[f64],
) -> Result<DMatrix<f64>, LikelihoodError> {
    let sensors = assembly.sensors().iter().map(|sensor| sensor.entries.clone());
    let joints = places.dofs[..places.joints].iter().map(|dof| vec![(*dof, 1.0)]);
    let readings: Vec<_> = sensors.chain(joints).collect();
    let lines = spread(omega);
    // Loads scaled with these units give displacements of similar size at all degrees of freedom,
    // even if the units of the degrees of freedom differ.
    let [low, high] = [lines.first(), lines.last()].map(|line| line.copied().unwrap_or(1.0));
    let pairs = nominal.diagonal(low).into_iter().zip(nominal.diagonal(high));
    let unit: Vec<f64> = pairs.map(|(a, b)| a.norm().max(b.norm()).sqrt()).collect();
    let mut basis = Basis::default();
    for omega in lines {
        let failed = LikelihoodError::NoResponse { at: "the initial values" };
        let motions = nominal.motions_per_force(omega, &readings).ok_or(failed)?;
        for motion in motions.column_iter() {
            let scaled = |part: fn(&nalgebra::Complex<f64>) -> f64| {
                let values = motion.iter().zip(&unit).map(|(z, unit)| part(z) * unit);
                DVector::from_iterator(motion.len(), values)
            };
            let (real, imaginary) = (scaled(|z| z.re), scaled(|z| z.im));
            let length = real.norm().hypot(imaginary.norm());
            if length > 0.0 {
                basis.push(real / length);
                basis.push(imaginary / length);
            }
        }
    }
    let mut loads = basis.leading().unwrap_or_else(|| DMatrix::zeros(assembly.dof(), 0));
    for (mut row, unit) in loads.row_iter_mut().zip(&unit) {
        row *= *unit;
    }
    Ok(loads)
}

/// Returns at most [`STATE_LINES`] of the frequencies, in rising order, including the lowest and
/// the highest.
fn spread(omega: &[f64]) -> Vec<f64> {
    let mut rising = omega.to_vec();
    rising.sort_by(f64::total_cmp);
    rising.dedup();
    let count = rising.len().min(STATE_LINES);
    (0..count).map(|at| rising[at * (rising.len() - 1) / (count - 1).max(1)]).collect()
}

/// Orthonormal basis of a set of vectors, and the components of the vectors in this basis.
#[derive(Default)]
struct Basis {
    vectors: Vec<DVector<f64>>,
    components: Vec<Vec<f64>>,
}

impl Basis {
    /// Adds a vector whose norm is at most 1.
    ///
    /// # Source
    /// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 5.2.9 (Gram–Schmidt; twice
    /// for orthogonality).
    fn push(&mut self, mut vector: DVector<f64>) {
        let mut components = vec![0.0; self.vectors.len()];
        for _ in 0..2 {
            for (of, component) in self.vectors.iter().zip(&mut components) {
                let part = of.dot(&vector);
                vector.axpy(-part, of, 1.0);
                *component += part;
            }
        }
        let length = vector.norm();
        if length > STATE_RESPONSE {
            components.push(length);
            self.vectors.push(vector / length);
        }
        self.components.push(components);
    }

    /// Returns the orthonormal directions in which the root mean square of the vectors is at least
    /// [`STATE_RESPONSE`]; `None` without vectors.
    fn leading(&self) -> Option<DMatrix<f64>> {
        let count = self.vectors.len();
        let mut gram = DMatrix::<f64>::zeros(count, count);
        for components in &self.components {
            for (j, b) in components.iter().enumerate() {
                for (i, a) in components.iter().enumerate() {
                    gram[(i, j)] += a * b;
                }
            }
        }
        let least = self.components.len() as f64 * STATE_RESPONSE.powi(2);
        let vectors = DMatrix::from_columns(&self.vectors);
        let eigen = hermitian_eigen(gram).ok()?;
        let directions = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter());
        let leading = directions.filter(|(power, _)| **power >= least);
        let leading: Vec<_> = leading.map(|(_, direction)| &vectors * direction).collect();
        (!leading.is_empty()).then(|| DMatrix::from_columns(&leading))
    }
}
