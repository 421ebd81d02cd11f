//! Operator of an open record: the impulse responses as one dense matrix.

use mechid_model::SecondOrderSystem;
use mechid_numerics::linear_algebra::svd;
use mechid_signal::{Extent, Sampling};
use nalgebra::{DMatrix, DVector};

use crate::band::BandFilter;
use crate::components::{Components, Operator};
use crate::error::ForceError;
use crate::limits;
use crate::measurement::{Measurement, Start};
use crate::state_space::{Machine, growth_rate};

/// Maximum number of unknowns (samples × forces) of an open record: the dense problem then takes
/// seconds.
pub const OPEN_UNKNOWNS: usize = 512;

pub(crate) struct OpenOperator {
    components: Components,
    /// Undamped coefficient y_i / s_i of each component.
    coefficients: Vec<f64>,
    /// Unknowns × components; the unknowns are ordered by force, then by sample.
    shapes: DMatrix<f64>,
    samples: usize,
    forces: usize,
    sampling: Sampling,
}

impl OpenOperator {
    pub fn new(
        system: &SecondOrderSystem,
        measured: &Measurement,
        forced: &[usize],
        start: Start,
        scale: &[f64],
    ) -> Result<Self, ForceError> {
        let (samples, forces) = (measured.sampling().len(), forced.len());
        if samples < 2 {
            return Err(ForceError::TooShort { samples, needed: 2 });
        }
        if samples * forces > OPEN_UNKNOWNS {
            let (unknowns, limit) = (samples * forces, OPEN_UNKNOWNS);
            return Err(ForceError::TooLarge { unknowns, limit });
        }
        let (rate, duration) = (growth_rate(system)?, measured.sampling().duration());
        if rate * duration > limits::FREE_GROWTH {
            return Err(ForceError::Unstable { rate, duration });
        }
        let machine = Machine::new(system, measured, forced, scale)?;
        let mut matrix = machine.impulse_responses(samples);
        let mut data = DVector::from_fn(samples * scale.len(), |row, _| {
            measured.record().data()[(row % samples, row / samples)] / scale[row / samples]
        });
        let rows = data.len();
        let mut freed = 0;
        if start == Start::InMotion {
            // The response to any initial state is projected out of the matrix and of the data.
            let free = machine.free_responses(samples).qr().q();
            freed = free.ncols();
            matrix -= &free * free.tr_mul(&matrix);
            data -= &free * free.tr_mul(&data);
        }
        let svd = svd(matrix)?;
        let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
        let parts = u.tr_mul(&data);
        let singular: Vec<f64> = svd.singular_values.iter().copied().collect();
        let coefficients =
            parts.iter().zip(&singular).map(|(y, s)| if *s > 0.0 { y / s } else { 0.0 }).collect();
        let shapes = v_t.transpose();
        let frequency: Vec<f64> =
            shapes.column_iter().map(|shape| frequency(shape.as_slice(), samples)).collect();
        let half_spacing = 0.5 * measured.sampling().line_spacing_hz();
        let components = Components {
            lowest_hz: frequency.iter().map(|rate| rate * half_spacing).collect(),
            frequency,
            energy: parts.iter().map(|y| y * y).collect(),
            weight: vec![1.0; singular.len()],
            singular,
            outside_energy: (data.norm_squared() - parts.norm_squared()).max(0.0),
            outside_weight: rows.saturating_sub(freed + parts.len()) as f64,
        };
        let sampling = measured.sampling();
        Ok(Self { components, coefficients, shapes, samples, forces, sampling })
    }
}

/// Returns the frequency of a force: its RMS change from sample to sample relative to its RMS
/// value, expressed as the number of half periods per record, at least one.
fn frequency(shape: &[f64], samples: usize) -> f64 {
    let steps = shape.chunks(samples).flat_map(|force| force.windows(2));
    let change: f64 = steps.map(|w| (w[1] - w[0]).powi(2)).sum();
    let size: f64 = shape.iter().map(|v| v * v).sum();
    let part = (change / size.max(f64::MIN_POSITIVE)).sqrt();
    (part * samples as f64 / std::f64::consts::PI).max(1.0)
}

impl Operator for OpenOperator {
    fn components(&self) -> &Components {
        &self.components
    }

    fn force(&self, factors: &[f64]) -> Result<DMatrix<f64>, ForceError> {
        let damped = DVector::from_fn(factors.len(), |i, _| factors[i] * self.coefficients[i]);
        let (samples, forces) = (nalgebra::Dyn(self.samples), nalgebra::Dyn(self.forces));
        Ok((&self.shapes * damped).reshape_generic(samples, forces))
    }

    fn keep(&mut self, band_hz: [f64; 2]) -> Result<(), ForceError> {
        let filter = BandFilter { sampling: self.sampling, band_hz, extent: Extent::Open };
        for mut shape in self.shapes.column_iter_mut() {
            for force in shape.as_mut_slice().chunks_mut(self.samples) {
                let filtered = filter.apply(force)?;
                force.copy_from_slice(&filtered);
            }
        }
        Ok(())
    }

    fn variance(&self, components: &[f64]) -> DMatrix<f64> {
        DMatrix::from_fn(self.samples, self.forces, |k, f| {
            let shape = self.shapes.row(f * self.samples + k);
            shape.iter().zip(components).map(|(v, variance)| v * v * variance).sum()
        })
    }
}
