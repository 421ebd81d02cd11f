//! Information gain of another sensor or another force.

use mechid_model::elements::{Input, InputColumn, Instruments, Machine, Sensor};
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix, DVector};

use super::{MachineEstimate, MachineModel};
use crate::likelihood::{LikelihoodError, LineResponse, ResponseModel};

/// A measurement that could be added.
#[derive(Debug, Clone, PartialEq)]
pub enum Candidate {
    /// An additional sensor in the same test; its noise is that of the sensors of the same
    /// quantity.
    Sensor(Sensor),
    /// A second test with the same sensors. This force acts instead of the forces of the first
    /// test. On each line, the amplitude of this force is the root mean square of the amplitudes of
    /// the forces of the first test.
    Force(Input),
}

/// Gain that a [`Candidate`] would bring.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct CandidateGain {
    /// Name of the sensor or the force.
    pub name: String,
    /// Logarithm of the ratio of the volumes of the confidence region without and with the
    /// candidate; infinite if a combination becomes determined.
    pub information_gain: f64,
    /// Number of parameters or combinations that become determined.
    pub newly_determined: usize,
    /// Standard errors with the candidate, in the order of the parameters and each in the unit of
    /// its parameter; `None` for a parameter that is still undetermined.
    pub standard_errors: Vec<Option<f64>>,
}

/// Minimum ratio of an eigenvalue of the scaled information to the largest one if the combination
/// is determined.
const RANK: f64 = 1e-13;

impl MachineEstimate {
    /// Ranks additional measurements for the test of this estimate, the best first.
    ///
    /// # Errors
    /// [`LikelihoodError::Machine`] for a candidate at an unknown degree of freedom.
    ///
    /// # Source
    /// Fedorov (1972), *Theory of Optimal Experiments*, chapter 2 (determinant of the information);
    /// Kammer (1991), J. Guidance, Control and Dynamics 14, 251–259 (places of sensors).
    pub fn rank_candidates(
        &self,
        data: &LineData,
        machine: &Machine,
        instruments: &Instruments,
        candidates: &[Candidate],
    ) -> Result<Vec<CandidateGain>, LikelihoodError> {
        let values = self.likelihood.values();
        let present = self.information(data, machine, instruments, &values)?;
        let (before, rank) = spectrum(&present);
        let mut gains = Vec::with_capacity(candidates.len());
        for candidate in candidates {
            let (name, more) = self.addition(data, machine, instruments, candidate, &values)?;
            let total = &present + more;
            let (after, rank_after) = spectrum(&total);
            let newly_determined = rank_after.saturating_sub(rank);
            let information_gain =
                if newly_determined > 0 { f64::INFINITY } else { 0.5 * (after - before) };
            let relative = standard_errors(&total);
            let absolute = |(error, value): (Option<f64>, &f64)| Some(error? * scale(*value));
            let standard_errors = relative.into_iter().zip(&values).map(absolute).collect();
            gains.push(CandidateGain { name, information_gain, newly_determined, standard_errors });
        }
        gains.sort_by(|a, b| {
            let rank = |gain: &CandidateGain| (gain.newly_determined, gain.information_gain);
            rank(b).partial_cmp(&rank(a)).unwrap_or(std::cmp::Ordering::Equal)
        });
        Ok(gains)
    }

    /// Returns JᵀJ of the present test, including the priors. Each column of J is multiplied by the
    /// scale of its parameter.
    fn information(
        &self,
        data: &LineData,
        machine: &Machine,
        instruments: &Instruments,
        values: &[f64],
    ) -> Result<DMatrix<f64>, LikelihoodError> {
        let mut information =
            self.gram(machine, instruments, data, data.inputs(), &self.variance, values)?;
        for (at, parameter) in self.likelihood.parameters.iter().enumerate() {
            if let Some(prior) = parameter.prior {
                information[(at, at)] += (scale(values[at]) / prior.standard_deviation).powi(2);
            }
        }
        Ok(information)
    }

    fn addition(
        &self,
        data: &LineData,
        machine: &Machine,
        instruments: &Instruments,
        candidate: &Candidate,
        values: &[f64],
    ) -> Result<(String, DMatrix<f64>), LikelihoodError> {
        match candidate {
            Candidate::Sensor(sensor) => {
                let with = Instruments { sensors: vec![sensor.clone()], ..instruments.clone() };
                let variance = self.sensor_variance(instruments, sensor);
                let more = self.gram(machine, &with, data, data.inputs(), &variance, values)?;
                Ok((sensor.name.clone(), more))
            }
            Candidate::Force(input) => {
                let with = Instruments { inputs: vec![input.clone()], ..instruments.clone() };
                let forces: Vec<usize> = (self.assembly.inputs().iter().enumerate())
                    .filter(|(_, input)| matches!(input, InputColumn::Force(_)))
                    .map(|(at, _)| at)
                    .collect();
                let size = |row: usize| {
                    let power: f64 =
                        forces.iter().map(|at| data.inputs()[(row, *at)].norm_sqr()).sum();
                    Complex::from((power / forces.len().max(1) as f64).sqrt())
                };
                let inputs = DMatrix::from_fn(data.len(), 1, |row, _| size(row));
                let more = self.gram(machine, &with, data, &inputs, &self.variance, values)?;
                Ok((input.name().to_owned(), more))
            }
        }
    }

    /// Returns the noise of a sensor: the mean variance of the sensors that measure the same
    /// quantity, corrected for the gains. If there is no such sensor, the mean is over all sensors.
    fn sensor_variance(&self, instruments: &Instruments, sensor: &Sensor) -> DMatrix<f64> {
        let same = |at: &usize| instruments.sensors[*at].quantity == sensor.quantity;
        let sensors: Vec<usize> = (0..self.variance.ncols()).collect();
        let mut like: Vec<usize> = sensors.iter().copied().filter(same).collect();
        if like.is_empty() {
            like = sensors;
        }
        DMatrix::from_fn(self.variance.nrows(), 1, |row, _| {
            let sum: f64 = like
                .iter()
                .map(|at| {
                    let gain = sensor.gain / instruments.sensors[*at].gain;
                    gain * gain * self.variance[(row, *at)]
                })
                .sum();
            sum / like.len() as f64
        })
    }

    /// Returns JᵀJ of a test with these instruments, inputs and lines. Each column of J is
    /// multiplied by the scale of its parameter.
    fn gram(
        &self,
        machine: &Machine,
        instruments: &Instruments,
        data: &LineData,
        inputs: &DMatrix<Complex<f64>>,
        variance: &DMatrix<f64>,
        values: &[f64],
    ) -> Result<DMatrix<f64>, LikelihoodError> {
        let assembly = machine.assembly(instruments)?;
        let model = MachineModel::new(&assembly, data.omega(), self.part.as_ref(), false)?;
        // With other sensors the machine may have fewer unknown delays, therefore the name
        // identifies a parameter.
        let mut places = Vec::new();
        for parameter in assembly.parameters() {
            let parameters = self.assembly.parameters();
            let index = parameters.iter().position(|other| other.name == parameter.name);
            let what = "unknown parameters that only a candidate has";
            places.push(index.ok_or(LikelihoodError::Size { what, expected: 0, got: 1 })?);
        }
        let values: Vec<f64> = places.iter().map(|place| values[*place]).collect();
        let (count, outputs) = (self.assembly.parameters().len(), assembly.sensors().len());
        let mut gram = DMatrix::zeros(count, count);
        let mut sensitivity = DMatrix::zeros(outputs, values.len());
        for row in 0..data.len() {
            let failed = LikelihoodError::NoResponse { at: "the estimate" };
            let line = model.at(&values, row).ok_or(failed)?;
            let input: DVector<Complex<f64>> = inputs.row(row).transpose();
            line.sensitivity(&values, &input, &DVector::zeros(0), &mut sensitivity);
            for (output, mut of_output) in sensitivity.row_iter_mut().enumerate() {
                let weight = (2.0 / variance[(row, output)]).sqrt();
                for (z, value) in of_output.iter_mut().zip(&values) {
                    *z *= weight * scale(*value);
                }
            }
            let of_line = (sensitivity.adjoint() * &sensitivity).map(|z| z.re);
            for (i, row) in places.iter().enumerate() {
                for (j, column) in places.iter().enumerate() {
                    gram[(*row, *column)] += of_line[(i, j)];
                }
            }
        }
        Ok(gram)
    }
}

/// Returns the scale of a parameter: its absolute value, or 1 if the value is 0.
fn scale(value: f64) -> f64 {
    if value == 0.0 { 1.0 } else { value.abs() }
}

/// Returns the sum of the logarithms of the eigenvalues above [`RANK`] times the largest one, and
/// the number of these eigenvalues.
fn spectrum(gram: &DMatrix<f64>) -> (f64, usize) {
    let Ok(eigen) = mechid_numerics::linear_algebra::hermitian_eigen(gram.clone()) else {
        return (f64::NAN, 0);
    };
    let largest = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
    let determined: Vec<f64> =
        eigen.eigenvalues.iter().copied().filter(|value| *value > RANK * largest).collect();
    (determined.iter().map(|value| value.ln()).sum(), determined.len())
}

/// Returns the relative standard errors of the parameters; `None` if an undetermined direction
/// depends on the parameter.
fn standard_errors(gram: &DMatrix<f64>) -> Vec<Option<f64>> {
    let count = gram.nrows();
    let Ok(eigen) = mechid_numerics::linear_algebra::hermitian_eigen(gram.clone()) else {
        return vec![None; count];
    };
    let largest = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
    let error = |at: usize| {
        let mut variance = 0.0;
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > RANK * largest {
                variance += vector[at] * vector[at] / value;
            } else if vector[at].abs() > 1e-6 {
                return None;
            }
        }
        Some(variance.sqrt())
    };
    (0..count).map(error).collect()
}
