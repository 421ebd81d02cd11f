//! Standard errors of least squares on the equation of motion, and the test of its residual.

use nalgebra::{Complex, DMatrix, DVector};

use super::Fit;
use crate::covariance::{BlockScores, ByPeriods, InTime, Uncertainty, block_count, in_time};
use crate::equations::Equations;
use crate::estimate::StandardErrors;
use crate::experiments::Columns;
use crate::grid::Grid;
use crate::limits::FEWEST;
use crate::scatter::{Line, PeriodScatter, Powers};
use crate::shape::Shape;

impl Fit {
    /// Returns the covariance of all parameters. It comes from the scatter of the periods if the
    /// residual does not exceed this scatter, otherwise from blocks of time. For a record too short
    /// for blocks, the covariance is the scatter increased to the size of the residual or, for a
    /// single period, the covariance for a white residual.
    pub(super) fn uncertainty(
        &self,
        equations: &Equations<'_>,
        shape: &Shape,
        residuals: &[DMatrix<Complex<f64>>],
        slopes: &[Vec<DMatrix<Complex<f64>>>],
        inverse: &DMatrix<f64>,
    ) -> Uncertainty {
        let by_periods = self.by_periods(equations, shape, residuals, slopes, inverse);
        let by_residual = || self.by_residual(equations, residuals, slopes, inverse);
        Uncertainty::new(by_periods, inverse.nrows(), by_residual)
    }

    /// Returns the scatter of the parameters from period to period, their bias, and the test of the
    /// residual against the scatter; `None` unless all experiments have several periods.
    ///
    /// The bias comes from the product of the noise in the regressors and in the residual. An
    /// estimate by instrumental variables, with one period as the instrument for the other periods,
    /// does not have this bias.
    ///
    /// # Source
    /// Söderström (2018), *Errors-in-Variables Methods in System Identification*, chapters 6 and 7.
    fn by_periods(
        &self,
        equations: &Equations<'_>,
        shape: &Shape,
        residuals: &[DMatrix<Complex<f64>>],
        slopes: &[Vec<DMatrix<Complex<f64>>>],
        inverse: &DMatrix<f64>,
    ) -> Option<ByPeriods> {
        let (rows, dof) = (&equations.rows, equations.data.dof());
        let parameters = inverse.nrows();
        let (mut scatter, mut powers) = (PeriodScatter::new(parameters), Powers::default());
        let mut products = DVector::zeros(parameters);
        for (at, (residual, slopes)) in residuals.iter().zip(slopes).enumerate() {
            let columns =
                equations.data.columns_of_periods(at, rows, shape.terms(), &shape.channels());
            if columns.is_empty() {
                return None;
            }
            scatter.count(columns.len());
            let periods = equations.residuals(&columns, &self.coefficients);
            let weight = |row: usize, dof: usize| self.weights.of_rows[(row, dof)];
            let mut weighted = vec![DMatrix::zeros(rows.len(), dof); periods.len()];
            for (row, line) in rows.iter().enumerate() {
                let is_real = *line == 0;
                let mut deviations = DMatrix::from_fn(dof, periods.len(), |dof, period| {
                    periods[period][(row, dof)] * weight(row, dof)
                });
                let mean = deviations.column_mean();
                deviations.column_iter_mut().for_each(|mut column| column -= &mean);
                let sensitivities_of =
                    |columns| self.sensitivities(equations, columns, slopes, row, parameters);
                let sensitivities = sensitivities_of(&self.columns[at]);
                let count = periods.len();
                for (columns, deviation) in columns.iter().zip(deviations.column_iter()) {
                    let product = (sensitivities_of(columns) - &sensitivities).ad_mul(&deviation);
                    products += product.map(|z| z.re / (count * (count - 1)) as f64);
                }
                let power = |values: &DMatrix<Complex<f64>>| -> f64 {
                    (0..dof).map(|dof| (values[(row, dof)] * weight(row, dof)).norm_sqr()).sum()
                };
                let noise = deviations.norm_squared() / (count * (count - 1)) as f64;
                let signal = power(&self.columns[at].force);
                powers.push([power(residual), noise, signal], count, is_real);
                for (period, values) in deviations.column_iter().zip(&mut weighted) {
                    values.row_mut(row).copy_from(&period.transpose());
                }
            }
            self.push_blocks(equations, at, slopes, &weighted, inverse, &mut scatter);
        }
        Some(ByPeriods { scatter, misfit: powers.misfit()?, bias: inverse * products })
    }

    /// Adds the blocks of time of an experiment to the scatter, from the weighted deviations of the
    /// periods (rows × degrees of freedom). Nonlinear terms multiply noise and response. This
    /// product correlates the lines, but hardly correlates the blocks of time.
    fn push_blocks(
        &self,
        equations: &Equations<'_>,
        at: usize,
        slopes: &[DMatrix<Complex<f64>>],
        deviations: &[DMatrix<Complex<f64>>],
        inverse: &DMatrix<f64>,
        scatter: &mut PeriodScatter,
    ) {
        let (data, parameters) = (equations.data, inverse.nrows());
        let blocks = block_count(data.period().duration(), self.slowest_decay(equations));
        let lines = data.period().len().div_ceil(2);
        let grid = Grid::new(lines, data.period().len());
        let time = |values: &[Complex<f64>]| in_time(&grid, lines, &equations.rows, values);
        let mut sums = vec![DMatrix::<Complex<f64>>::zeros(parameters, deviations.len()); blocks];
        for dof in 0..data.dof() {
            let regressors = self.regressors_in_time(equations, at, slopes, dof, &time);
            for (period, deviation) in deviations.iter().enumerate() {
                let noise = time(deviation.column(dof).as_slice());
                for (index, regressor) in &regressors {
                    for (block, sums) in sums.iter_mut().enumerate() {
                        let len = noise.len();
                        let range = block * len / blocks..(block + 1) * len / blocks;
                        let pairs = regressor[range.clone()].iter().zip(&noise[range]);
                        sums[(*index, period)] += pairs.map(|(a, b)| a * b).sum::<f64>();
                    }
                }
            }
        }
        let unit = DMatrix::identity(parameters, parameters);
        for deviations in &sums {
            scatter.push(inverse, &unit, &Line { deviations, weight: 1.0, is_real: true });
        }
    }

    /// Returns the weighted regressors of one equation of an experiment as time signals, each with
    /// the index of its parameter.
    fn regressors_in_time(
        &self,
        equations: &Equations<'_>,
        at: usize,
        slopes: &[DMatrix<Complex<f64>>],
        dof: usize,
        time: &impl Fn(&[Complex<f64>]) -> Vec<f64>,
    ) -> Vec<(usize, Vec<f64>)> {
        let weights = &self.weights.of_rows;
        let linear = equations.weighted(&self.columns[at], weights, dof);
        let mut regressors: Vec<_> = linear.map(|(index, values)| (index, time(&values))).collect();
        for (number, slope) in slopes.iter().enumerate() {
            let value = |row: usize| slope[(row, dof)] * weights[(row, dof)];
            let values: Vec<_> = (0..equations.rows.len()).map(value).collect();
            regressors.push((equations.count() + number, time(&values)));
        }
        regressors
    }

    /// Returns the weighted regressors of all parameters for one row: degrees of freedom ×
    /// parameters.
    fn sensitivities(
        &self,
        equations: &Equations<'_>,
        columns: &Columns,
        slopes: &[DMatrix<Complex<f64>>],
        row: usize,
        parameters: usize,
    ) -> DMatrix<Complex<f64>> {
        let dof = equations.data.dof();
        let mut sensitivities = DMatrix::zeros(dof, parameters);
        for dof in 0..dof {
            let weight = self.weights.of_rows[(row, dof)];
            for (at, value) in equations.regressors(columns, row, dof) {
                sensitivities[(dof, at)] = value * weight;
            }
            for (at, slope) in slopes.iter().enumerate() {
                sensitivities[(dof, equations.count() + at)] = slope[(row, dof)] * weight;
            }
        }
        sensitivities
    }

    fn by_residual(
        &self,
        equations: &Equations<'_>,
        residuals: &[DMatrix<Complex<f64>>],
        slopes: &[Vec<DMatrix<Complex<f64>>>],
        inverse: &DMatrix<f64>,
    ) -> (DMatrix<f64>, StandardErrors, usize) {
        let (data, weights) = (equations.data, &self.weights.of_rows);
        let parameters = inverse.nrows();
        let blocks = block_count(data.period().duration(), self.slowest_decay(equations));
        if blocks * data.count() >= FEWEST {
            let lines = data.period().len().div_ceil(2);
            let grid = Grid::new(lines, data.period().len());
            let time = |values: &[Complex<f64>]| in_time(&grid, lines, &equations.rows, values);
            let mut scores = BlockScores::new(parameters);
            for (at, (residual, slopes)) in residuals.iter().zip(slopes).enumerate() {
                let part = |dof: usize| {
                    let weigh = |values: &DMatrix<Complex<f64>>| {
                        let one = |row: usize| values[(row, dof)] * weights[(row, dof)];
                        time(&(0..equations.rows.len()).map(one).collect::<Vec<_>>())
                    };
                    let regressors = self.regressors_in_time(equations, at, slopes, dof, &time);
                    InTime { regressors, residual: weigh(residual) }
                };
                let parts: Vec<_> = (0..data.dof()).map(part).collect();
                scores.push(blocks, &parts);
            }
            let count = scores.count();
            if let Some((covariance, freedom)) = scores.covariance(inverse, parameters) {
                return (covariance, StandardErrors::Blocks(count), freedom);
            }
        }
        let square: f64 = residuals
            .iter()
            .flat_map(|residual| residual.iter().zip(weights.iter()))
            .map(|(e, w)| (e * *w).norm_sqr())
            .sum();
        let freedom = equations.equations().saturating_sub(parameters);
        let variance = if freedom > 0 { square / freedom as f64 } else { f64::INFINITY };
        (inverse * variance, StandardErrors::White, freedom)
    }
}
