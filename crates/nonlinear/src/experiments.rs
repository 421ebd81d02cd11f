//! Steady periods of one or several experiments, and their regressors for nonlinear terms.

use mechid_estimate::EstimateError;
use mechid_model::{ResponseQuantity, Terms};
use mechid_numerics::check_size;
use mechid_signal::{Record, Sampling, Spectrum};
use mechid_spectra::{Lines, check_sampling};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use super::ChannelPhase;
use super::channel_phase::displacement_lines;
use super::grid::Grid;
use crate::limits::EXPERIMENT_FINER;

/// Steady-state forces and responses under periodic excitation, one mean period per experiment.
///
/// Unlike [`FrequencyData`](mechid_spectra::FrequencyData) it contains all lines of the period: a
/// nonlinear system responds on all lines even if the force has few lines, and the computation of a
/// power of the response needs all lines. The equation of motion is fitted on `lines`, including
/// lines without force.
pub struct SteadyExperiments {
    lines: Vec<usize>,
    period: Sampling,
    dof: usize,
    measured: ResponseQuantity,
    grid: Grid,
    steady: Vec<Experiment>,
}

/// One experiment: its periods and their mean.
struct Experiment {
    /// Mean of the periods.
    mean: Steady,
    /// Single periods; empty if there is only one period.
    periods: Vec<Steady>,
}

/// Lines 0, 1, … of one period, below half the sampling rate: lines × degrees of freedom.
struct Steady {
    force: DMatrix<Complex<f64>>,
    displacement: DMatrix<Complex<f64>>,
}

/// Columns of the equations of motion of one experiment, on the lines of a fit.
pub(super) struct Columns {
    /// Force, rows × degrees of freedom.
    pub(super) force: DMatrix<Complex<f64>>,
    /// Displacement, rows × degrees of freedom.
    pub(super) displacement: DMatrix<Complex<f64>>,
    /// Force of each term per unit of its coefficient, rows × terms.
    pub(super) terms: DMatrix<Complex<f64>>,
}

impl SteadyExperiments {
    /// Creates an empty set for `dof` degrees of freedom; the equation of motion will be fitted on
    /// `lines` of a period.
    pub fn new(lines: &Lines, dof: usize, measured: ResponseQuantity) -> Self {
        let period = lines.sampling();
        let mut rising = lines.as_slice().to_vec();
        rising.sort_unstable();
        rising.dedup();
        let grid = Grid::new(period.len().div_ceil(2), EXPERIMENT_FINER * period.len());
        Self { lines: rising, period, dof, measured, grid, steady: Vec::new() }
    }

    /// Adds an experiment: the mean of the whole periods of force (N) and response (m, m/s or
    /// m/s²); an incomplete period at the end is ignored.
    ///
    /// Even powers depend on the zero of the displacement: first subtract the offset of the sensor
    /// or, if it is unknown, the mean of the whole record ([`Record::without_mean`]).
    ///
    /// # Errors
    /// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) for a wrong number of
    /// channels, [`EstimateError::Signal`] if the time step differs from the time step of the
    /// lines, or a record is shorter than one period.
    pub fn push(&mut self, force: &Record, response: &Record) -> Result<(), EstimateError> {
        force.check_same_sampling(response)?;
        check_size("channels of the force", self.dof, force.channels())?;
        check_size("channels of the response", self.dof, response.channels())?;
        let len = self.period.len();
        let [mean_force, mean_response] = [force, response].map(|r| r.period_mean(len));
        let mean = self.period_of(&mean_force?, &mean_response?)?;
        let count = match force.len() / len {
            0 | 1 => 0,
            several => several,
        };
        let one = |period: usize| {
            let [force, response] = [force, response].map(|r| r.window(period * len, len));
            self.period_of(&force?, &response?)
        };
        let periods = (0..count).map(one).collect::<Result<_, _>>()?;
        self.steady.push(Experiment { mean, periods });
        Ok(())
    }

    fn period_of(&self, force: &Record, response: &Record) -> Result<Steady, EstimateError> {
        check_sampling(self.period, force.sampling())?;
        let lines = self.period.len().div_ceil(2);
        Ok(Steady {
            force: Spectrum::from_record(force).lines().rows(0, lines).into_owned(),
            displacement: displacement_lines(&Spectrum::from_record(response), self.measured),
        })
    }

    /// Returns the number of experiments.
    pub fn count(&self) -> usize {
        self.steady.len()
    }

    /// Returns the quantity of the responses.
    pub fn measured(&self) -> ResponseQuantity {
        self.measured
    }

    /// Returns the number of degrees of freedom.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// Returns the lines on which the equation of motion is fitted, rising.
    pub fn lines(&self) -> &[usize] {
        &self.lines
    }

    /// Returns the time axis of one period.
    pub fn period(&self) -> Sampling {
        self.period
    }

    /// Returns, for each experiment, the columns of the equations of motion of its mean period on
    /// the lines `rows`.
    pub(super) fn columns(
        &self,
        rows: &[usize],
        terms: &Terms,
        channels: &ChannelPhase,
    ) -> Vec<Columns> {
        let mean = |one: &Experiment| self.columns_of(&one.mean, rows, terms, channels);
        self.steady.par_iter().map(mean).collect()
    }

    /// Returns, for each period of an experiment, the columns of the equations of motion on the
    /// lines `rows`; empty for a single period.
    pub(super) fn columns_of_periods(
        &self,
        experiment: usize,
        rows: &[usize],
        terms: &Terms,
        channels: &ChannelPhase,
    ) -> Vec<Columns> {
        let periods = self.steady[experiment].periods.par_iter();
        periods.map(|one| self.columns_of(one, rows, terms, channels)).collect()
    }

    fn columns_of(
        &self,
        steady: &Steady,
        rows: &[usize],
        terms: &Terms,
        channels: &ChannelPhase,
    ) -> Columns {
        let corrections = self.corrections(channels);
        let corrected = |lines: &DMatrix<Complex<f64>>, which: usize| {
            DMatrix::from_fn(rows.len(), self.dof, |at, dof| {
                lines[(rows[at], dof)] * corrections[rows[at]][which]
            })
        };
        let signals = self.signals(steady, &corrections, terms);
        let mut term_columns = DMatrix::zeros(rows.len(), terms.len());
        let samples = EXPERIMENT_FINER * self.period.len();
        for (term, mut column) in terms.iter().zip(term_columns.column_iter_mut()) {
            let mut values = vec![0.0; samples];
            let (mut x, mut v) = (vec![0.0; self.dof], vec![0.0; self.dof]);
            for (k, value) in values.iter_mut().enumerate() {
                for (dof, signal) in signals.iter().enumerate() {
                    if let Some([displacement, velocity]) = signal {
                        (x[dof], v[dof]) = (displacement[k], velocity[k]);
                    }
                }
                *value = term.value(&x, &v);
            }
            let lines = self.grid.to_lines(values);
            column.iter_mut().zip(rows).for_each(|(entry, row)| *entry = lines[*row]);
        }
        Columns {
            force: corrected(&steady.force, 0),
            displacement: corrected(&steady.displacement, 1),
            terms: term_columns,
        }
    }

    /// Returns displacement (m) and velocity (m/s), on the finer time grid, for those degrees of
    /// freedom that terms depend on.
    fn signals(
        &self,
        steady: &Steady,
        corrections: &[[Complex<f64>; 2]],
        terms: &Terms,
    ) -> Vec<Option<[Vec<f64>; 2]>> {
        let signal = |dof: usize| {
            let needed = terms.iter().any(|term| term.coordinate().sign(dof) != 0.0);
            needed.then(|| {
                let lines = steady.displacement.column(dof);
                let line = |n: usize| lines[n] * corrections[n][1];
                let velocity = |n: usize| line(n) * Complex::new(0.0, self.omega(n));
                let count = lines.len();
                [
                    self.grid.to_samples((0..count).map(line)),
                    self.grid.to_samples((0..count).map(velocity)),
                ]
            })
        };
        (0..self.dof).map(signal).collect()
    }

    /// Returns the displacement of every experiment, corrected for the channels: lines × degrees of
    /// freedom.
    pub(super) fn displacements(&self, channels: &ChannelPhase) -> Vec<DMatrix<Complex<f64>>> {
        let corrections = self.corrections(channels);
        let corrected = |one: &Experiment| {
            let mut lines = one.mean.displacement.clone();
            for (mut row, [_, correction]) in lines.row_iter_mut().zip(&corrections) {
                row.iter_mut().for_each(|line| *line *= *correction);
            }
            lines
        };
        self.steady.iter().map(corrected).collect()
    }

    fn corrections(&self, channels: &ChannelPhase) -> Vec<[Complex<f64>; 2]> {
        let half = 0.5 * self.period.len() as f64;
        let at = |n: usize| channels.corrections(self.omega(n), n as f64 / half);
        (0..self.period.len().div_ceil(2)).map(at).collect()
    }

    pub(super) fn omega(&self, line: usize) -> f64 {
        line as f64 * self.period.omega0()
    }

    /// Returns the largest |q| (m) and |q̇| (m/s) of all experiments for the coordinate of each
    /// term.
    pub(super) fn ranges(&self, terms: &Terms, channels: &ChannelPhase) -> Vec<[f64; 2]> {
        let corrections = self.corrections(channels);
        let mut ranges = vec![[0.0f64; 2]; terms.len()];
        for Experiment { mean, .. } in &self.steady {
            let signals = self.signals(mean, &corrections, terms);
            for (term, range) in terms.iter().zip(&mut ranges) {
                for k in 0..EXPERIMENT_FINER * self.period.len() {
                    for (kind, largest) in range.iter_mut().enumerate() {
                        let signal = |dof: usize| signals[dof].as_ref().map_or(0.0, |s| s[kind][k]);
                        let sum =
                            (0..self.dof).map(|dof| term.coordinate().sign(dof) * signal(dof));
                        *largest = largest.max(sum.sum::<f64>().abs());
                    }
                }
            }
        }
        ranges
    }
}
