//! Line data arranged for the search: loads (forces and transients) and blocks of lines.

use std::ops::Range;

use mechid_spectra::{LineData, Transient};
use nalgebra::Complex;

use crate::ModalError;
use crate::delays::OutputDelay;
use crate::limits::{BLOCK_LINES, DEAD_CHANNEL, DEPENDENT_INPUTS, OUTSIDE_DISTANCE};

/// One column of the inputs: a measured force, or the transient of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Load {
    /// A measured input.
    Force(usize),
    /// Difference between the states at the two ends of an open record.
    Transient(usize),
}

/// Lines of one record that are summed together.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    /// Rows of the line data.
    pub(crate) rows: Range<usize>,
    /// Loads that act on the lines of the block.
    pub(crate) active: Vec<usize>,
    /// Sampling interval Δt, in s, and e^{−jωΔt} on each line; `None` unless the record is open.
    pub(crate) delay: Option<(f64, Vec<Complex<f64>>)>,
}

impl Block {
    /// Returns the number of lines.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }
}

/// Line data with its loads and blocks.
#[derive(Debug, Clone)]
pub(crate) struct Lines {
    pub(crate) omega: Vec<f64>,
    pub(crate) outputs: Vec<Vec<Complex<f64>>>,
    pub(crate) loads: Vec<Load>,
    /// Amplitude of each load on every line; empty for a transient, whose amplitude is 1 on all
    /// lines of its record.
    pub(crate) amplitude: Vec<Vec<Complex<f64>>>,
    pub(crate) blocks: Vec<Block>,
    /// Delays that were removed from the outputs; empty if no delay was removed.
    pub(crate) delays: Vec<OutputDelay>,
    /// Stated variance (positive) of each output's noise on every line; empty if it is unknown.
    pub(crate) stated_noise: Vec<Vec<f64>>,
}

impl Lines {
    /// Arranges line data.
    pub(crate) fn new(data: &LineData) -> Self {
        let mut loads: Vec<Load> = (0..data.inputs().ncols()).map(Load::Force).collect();
        let columns = |matrix: &nalgebra::DMatrix<Complex<f64>>| -> Vec<Vec<Complex<f64>>> {
            matrix.column_iter().map(|column| column.iter().copied().collect()).collect()
        };
        let mut amplitude = columns(data.inputs());
        let mut blocks = Vec::new();
        for (record, (rows, transient)) in data.records().iter().enumerate() {
            let zero = Complex::default();
            let drives = |force: &usize| amplitude[*force][rows.clone()].iter().any(|z| *z != zero);
            let mut active: Vec<usize> = (0..data.inputs().ncols()).filter(drives).collect();
            if let Transient::Open { .. } = transient {
                active.push(loads.len());
                loads.push(Load::Transient(record));
                amplitude.push(Vec::new());
            }
            let count = rows.len().div_ceil(BLOCK_LINES).max(1);
            for part in 0..count {
                let at = |part: usize| rows.start + rows.len() * part / count;
                let rows = at(part)..at(part + 1);
                let delay = match *transient {
                    Transient::None => None,
                    Transient::Open { sample_interval: dt } => {
                        let turn = |omega: &f64| Complex::cis(-omega * dt);
                        Some((dt, data.omega()[rows.clone()].iter().map(turn).collect()))
                    }
                };
                blocks.push(Block { rows, active: active.clone(), delay });
            }
        }
        blocks.retain(|block| block.len() > 0);
        let (omega, outputs) = (data.omega().to_vec(), columns(data.outputs()));
        let variances = |matrix: &nalgebra::DMatrix<f64>| -> Vec<Vec<f64>> {
            matrix.column_iter().map(|column| column.iter().copied().collect()).collect()
        };
        let stated_noise = data.output_variance().map(variances).unwrap_or_default();
        let delays = Vec::new();
        Self { omega, outputs, loads, amplitude, blocks, delays, stated_noise }
    }

    /// Returns an output without its delay; `delay` is in s.
    pub(crate) fn advanced_output(&self, output: usize, delay: f64) -> Vec<Complex<f64>> {
        let values = self.outputs[output].iter().zip(&self.omega);
        values.map(|(value, omega)| value * Complex::cis(omega * delay)).collect()
    }

    /// Returns the same lines with these delays removed from the outputs; an empty list does not
    /// change the outputs.
    pub(crate) fn advanced(&self, delays: Vec<OutputDelay>) -> Self {
        let mut lines = self.clone();
        for (output, delay) in delays.iter().enumerate() {
            lines.outputs[output] = self.advanced_output(output, delay.seconds);
        }
        lines.delays = delays;
        lines
    }

    /// Returns the penalty of one unknown in −2 log L by Schwarz's criterion.
    pub(crate) fn schwarz(&self) -> f64 {
        ((2 * self.len()) as f64).ln()
    }

    /// Returns the number of lines.
    pub(crate) fn len(&self) -> usize {
        self.omega.len()
    }

    /// Returns the number of measured inputs.
    pub(crate) fn inputs(&self) -> usize {
        self.loads.iter().filter(|load| matches!(load, Load::Force(_))).count()
    }

    /// Returns the lowest and the highest angular frequency, in rad/s.
    pub(crate) fn band(&self) -> (f64, f64) {
        let fold = |(low, high): (f64, f64), w: &f64| (low.min(*w), high.max(*w));
        self.omega.iter().fold((f64::INFINITY, 0.0), fold)
    }

    /// Returns whether the frequency of a pole is in the band.
    pub(crate) fn contains(&self, pole: Complex<f64>) -> bool {
        let (low, high) = self.band();
        pole.im >= low && pole.im <= high
    }

    /// Returns whether a pole is in the band or near it. Residual terms cannot always describe the
    /// resonance of such a pole.
    pub(crate) fn reaches(&self, pole: Complex<f64>) -> bool {
        let (low, high) = self.band();
        let margin = OUTSIDE_DISTANCE * (high - low);
        pole.im > (low - margin).max(0.0) && pole.im < high + margin
    }

    /// Returns the amplitude of a load on a line; the load must act in the block of this line.
    pub(crate) fn load(&self, load: usize, row: usize) -> Complex<f64> {
        self.amplitude[load].get(row).copied().unwrap_or(Complex::new(1.0, 0.0))
    }

    /// Returns the root-mean-square of a load over the lines on which it acts; 0 if it acts on no
    /// line.
    pub(crate) fn load_level(&self, load: usize) -> f64 {
        let acts = |block: &&Block| block.active.contains(&load);
        let (mut power, mut count) = (0.0, 0);
        for block in self.blocks.iter().filter(acts) {
            power += block.rows.clone().map(|row| self.load(load, row).norm_sqr()).sum::<f64>();
            count += block.len();
        }
        (power / count.max(1) as f64).sqrt()
    }

    /// Checks that the channels suffice to identify modes.
    pub(crate) fn check(&self) -> Result<(), ModalError> {
        if self.outputs.is_empty() {
            return Err(ModalError::NoOutput);
        }
        if self.loads.is_empty() {
            return Err(ModalError::NoExcitation);
        }
        let required = 2 * (self.loads.len() + 2);
        if self.len() < required {
            return Err(ModalError::TooFewLines { lines: self.len(), required });
        }
        let outputs = dead(&self.outputs);
        if !outputs.is_empty() {
            return Err(ModalError::DeadOutputs { outputs });
        }
        let inputs = dead(&self.amplitude[..self.inputs()]);
        if !inputs.is_empty() {
            return Err(ModalError::DeadInputs { inputs });
        }
        self.check_independence()
    }

    /// Checks by Gram–Schmidt, column by column, that no input is a combination of the preceding
    /// inputs.
    fn check_independence(&self) -> Result<(), ModalError> {
        let mut basis: Vec<Vec<Complex<f64>>> = Vec::new();
        for input in 0..self.inputs() {
            let mut remainder = self.amplitude[input].clone();
            let level = remainder.iter().map(|z| z.norm_sqr()).sum::<f64>().sqrt();
            for _ in 0..2 {
                for direction in &basis {
                    let products = direction.iter().zip(&remainder).map(|(q, z)| q.conj() * z);
                    let part: Complex<f64> = products.sum();
                    for (z, q) in remainder.iter_mut().zip(direction) {
                        *z -= part * q;
                    }
                }
            }
            let length = remainder.iter().map(|z| z.norm_sqr()).sum::<f64>().sqrt();
            let own_share = length / level;
            if own_share < DEPENDENT_INPUTS {
                return Err(ModalError::DependentInputs { input, own_share });
            }
            remainder.iter_mut().for_each(|z| *z /= length);
            basis.push(remainder);
        }
        Ok(())
    }
}

/// Returns the channels with negligible power, relative to the strongest channel.
fn dead(channels: &[Vec<Complex<f64>>]) -> Vec<usize> {
    let power = |channel: &Vec<Complex<f64>>| channel.iter().map(|z| z.norm_sqr()).sum::<f64>();
    let powers: Vec<f64> = channels.iter().map(power).collect();
    let strongest = powers.iter().copied().fold(0.0, f64::max);
    let silent = |index: &usize| powers[*index] <= strongest * DEAD_CHANNEL;
    (0..channels.len()).filter(silent).collect()
}
