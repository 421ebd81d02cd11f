//! Sinusoids of unknown frequency in the responses of open records. Their causes are run-out,
//! unbalance or mains hum.
//!
//! A sinusoid between two lines leaks to all lines with a fixed phase. Neither a noise spectrum nor
//! the exclusion of lines can describe this leakage. A sinusoid that is much stronger than the
//! noise is fitted, under Hann's window, to the lines around its frequency, and is subtracted from
//! all lines.

use std::f64::consts::LN_2;
use std::ops::Range;

use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_signal::Sampling;
use nalgebra::{Complex, DMatrix};

use crate::frequency_data::FrequencyData;
use crate::limits::{
    GAINS_PER_LINE, MAX_CANDIDATES, SINUSOID_AROUND, SINUSOID_BESIDE, SINUSOID_CHECKED_LINES,
    SINUSOID_CONSPICUOUS, SINUSOID_FEWEST, SINUSOID_FITTED, SINUSOID_FREQUENCIES, SINUSOID_LEFT,
    SINUSOID_MOST, SINUSOID_NEXT, SINUSOID_ROUNDS, SINUSOID_SECTIONS,
};
use crate::open_record::OpenRecord;

/// Sinusoid in the response that is not caused by the forces: Re(c e^{iωt}) in each channel, where
/// t is 0 at the first sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Sinusoid {
    /// Nearest line.
    line: usize,
    omega: f64,
    amplitude: Vec<Complex<f64>>,
}

impl Sinusoid {
    /// Returns the angular frequency ω, in rad/s.
    pub fn omega(&self) -> f64 {
        self.omega
    }

    /// Returns the complex amplitude c of each channel, in the unit of the measured quantity.
    pub fn amplitude(&self) -> &[Complex<f64>] {
        &self.amplitude
    }

    /// Returns the number of real unknowns: two for each channel, and the frequency.
    pub fn unknowns(&self) -> usize {
        2 * self.amplitude.len() + 1
    }

    /// Returns the amplitude of the sinusoid in channel `channel` at a line, in the unit of the
    /// measured quantity.
    fn read(&self, sampling: Sampling, line: usize, channel: usize) -> Complex<f64> {
        let [before, after] = sides(sampling, self.omega, line);
        self.amplitude[channel] * before + self.amplitude[channel].conj() * after
    }
}

/// Returns the amplitudes of e^{iωt}/2 and e^{−iωt}/2 at a line. Their sum is the amplitude, at
/// this line, of a cosine of amplitude 1.
fn sides(sampling: Sampling, omega: f64, line: usize) -> [Complex<f64>; 2] {
    let samples = sampling.len() as f64;
    // This is the sum of a geometric series, divided by its number of terms.
    let mean = |turn: f64| {
        let half = 0.5 * turn;
        match half.sin() {
            0.0 => Complex::ONE,
            sine => {
                Complex::cis((samples - 1.0) * half) * ((samples * half).sin() / (samples * sine))
            }
        }
    };
    let of_line = line as f64 * sampling.omega0() * sampling.dt();
    [omega, -omega].map(|omega| mean(omega * sampling.dt() - of_line))
}

impl FrequencyData {
    /// Returns the rows of open records with the sinusoids of each record subtracted from the
    /// displacement, as the maximum-likelihood estimator estimated them.
    #[must_use]
    pub fn without_sinusoids(&self, sinusoids: &[Vec<Sinusoid>]) -> Self {
        let mut displacement = self.displacement().clone();
        for (record, sinusoids) in sinusoids.iter().enumerate() {
            let Some(OpenRecord { sampling, rows }) = self.open_record(record) else { break };
            for row in rows {
                let (omega, line) = (self.omega()[row], self.line(row, sampling));
                let unit = self.measured().per_displacement(omega).inv();
                for (channel, x) in displacement.row_mut(row).iter_mut().enumerate() {
                    let read =
                        sinusoids.iter().map(|sinusoid| sinusoid.read(sampling, line, channel));
                    *x -= read.sum::<Complex<f64>>() * unit;
                }
            }
        }
        self.with_displacement(displacement)
    }

    fn line(&self, row: usize, sampling: Sampling) -> usize {
        (self.omega()[row] / sampling.omega0()).round() as usize
    }
}

/// Returns, for each open record of the data, the sinusoids that are much stronger than the noise
/// in a residual (rows × n, in m). The sinusoids `known` from a previous residual are fitted first.
///
/// Lines with a peak of the force are excluded, because the residual on them may come from the
/// system. If the `system` is given, the threshold at its resonances is multiplied by the ratio of
/// the squared receptance at the resonance to the squared receptance on the surrounding lines,
/// because the response to a disturbance of the force has the shape of the receptance.
///
/// # Source
/// Rife & Boorstyn (1974), IEEE Transactions on Information Theory 20, 591–598 (frequency of a
/// sinusoid in noise); Harris (1978), Proceedings of the IEEE 66, 51–83 (Hann's window); the limits
/// are ours.
pub fn find(
    data: &FrequencyData,
    residual: &DMatrix<Complex<f64>>,
    system: Option<&SecondOrderSystem>,
    known: &[Vec<Sinusoid>],
) -> Vec<Vec<Sinusoid>> {
    let records = (0..).map_while(|record| data.open_record(record));
    let sinusoids = records.enumerate().map(|(at, record)| {
        let known = known.get(at).map_or(&[][..], Vec::as_slice);
        Search::new(data, residual, system, record).sinusoids(known)
    });
    sinusoids.collect()
}

/// Search for sinusoids in one record, on all lines from the first to the last line of the record.
struct Search<'a> {
    system: Option<&'a SecondOrderSystem>,
    measured: ResponseQuantity,
    sampling: Sampling,
    first: usize,
    /// `true` for each line that is in the data together with the lines before and after it.
    has_both_neighbours: Vec<bool>,
    /// Residual in the measured quantity, lines × channels.
    residual: DMatrix<Complex<f64>>,
    /// Mean power around each line under Hann's window, lines × channels; infinite if there are too
    /// few lines around it.
    level: DMatrix<f64>,
    /// `true` for each line whose level includes the factor for the receptance.
    is_resonant: Vec<bool>,
    /// `true` for each line that is excluded from the search.
    is_excluded: Vec<bool>,
}

impl<'a> Search<'a> {
    fn new(
        data: &FrequencyData,
        residual: &DMatrix<Complex<f64>>,
        system: Option<&'a SecondOrderSystem>,
        record: OpenRecord,
    ) -> Self {
        let OpenRecord { sampling, rows } = record;
        let lines: Vec<usize> = rows.clone().map(|row| data.line(row, sampling)).collect();
        let ends = (lines.iter().min().copied(), lines.iter().max().copied());
        let (first, last) = (ends.0.unwrap_or(0), ends.1.unwrap_or(0));
        let (count, n) = (last - first + 1, data.dof());
        let mut there = vec![false; count];
        let (mut own, mut force) = (DMatrix::zeros(count, n), DMatrix::zeros(count, n));
        for (row, line) in rows.zip(&lines) {
            there[line - first] = true;
            let unit = data.measured().per_displacement(data.omega()[row]);
            own.row_mut(line - first).copy_from(&(residual.row(row) * unit));
            force.row_mut(line - first).copy_from(&data.force().row(row));
        }
        let has_both_neighbours = (0..count)
            .map(|at| at > 0 && at + 1 < count && there[at - 1] && there[at] && there[at + 1]);
        let has_both_neighbours: Vec<bool> = has_both_neighbours.collect();
        let level = levels(&hann(&own), &has_both_neighbours);
        let force = hann(&force);
        let of_force = levels(&force, &has_both_neighbours);
        let stands_out = |at: usize| {
            (0..n).any(|c| force[(at, c)].norm_sqr() > SINUSOID_CONSPICUOUS * of_force[(at, c)])
        };
        let mut is_excluded = vec![false; count];
        for at in (0..count).filter(|at| stands_out(*at)) {
            is_excluded[around(at, SINUSOID_NEXT, count)].fill(true);
        }
        let is_resonant = vec![false; count];
        let measured = data.measured();
        Self {
            system,
            measured,
            sampling,
            first,
            has_both_neighbours,
            residual: own,
            level,
            is_resonant,
            is_excluded,
        }
    }

    fn sinusoids(mut self, known: &[Sinusoid]) -> Vec<Sinusoid> {
        let mut sinusoids = known.to_vec();
        sinusoids.iter().for_each(|sinusoid| self.add_scaled(sinusoid, -1.0));
        self.refine(&mut sinusoids);
        sinusoids.retain(|sinusoid| {
            self.add_scaled(sinusoid, 1.0);
            let at = sinusoid.line - self.first;
            self.allow_for_receptance(at);
            let stands_out = self.power_ratio(&hann(&self.residual), at) > SINUSOID_CONSPICUOUS;
            if stands_out {
                self.add_scaled(sinusoid, -1.0);
            }
            stands_out
        });
        let mut windowed = hann(&self.residual);
        let mut least = SINUSOID_CONSPICUOUS;
        for _ in 0..MAX_CANDIDATES {
            let Some((ratio, at)) = self.most_conspicuous(&windowed) else { break };
            if ratio <= least || sinusoids.len() >= SINUSOID_MOST {
                break;
            }
            if !self.is_resonant[at] {
                self.allow_for_receptance(at);
                continue;
            }
            let sinusoid = self.fit(&windowed, at);
            self.add_scaled(&sinusoid, -1.0);
            let less = hann(&self.residual);
            let [before, after] = [&windowed, &less].map(|of| self.excess(of, at));
            if after <= SINUSOID_LEFT * before {
                least = least.max(SINUSOID_BESIDE * ratio);
                sinusoids.push(sinusoid);
                windowed = less;
            } else {
                self.add_scaled(&sinusoid, 1.0);
                let count = self.is_excluded.len();
                self.is_excluded[around(at, SINUSOID_CHECKED_LINES, count)].fill(true);
            }
        }
        self.refine(&mut sinusoids);
        sinusoids
    }

    /// Fits each sinusoid again after all other sinusoids have been subtracted.
    fn refine(&mut self, found: &mut [Sinusoid]) {
        for _ in 0..SINUSOID_ROUNDS {
            for sinusoid in &mut *found {
                self.add_scaled(sinusoid, 1.0);
                *sinusoid = self.fit(&hann(&self.residual), sinusoid.line - self.first);
                self.add_scaled(sinusoid, -1.0);
            }
        }
    }

    /// Raises the level around a line, at most once, by the ratio of the mean squared receptance
    /// near the line to the median squared receptance of the lines around it.
    fn allow_for_receptance(&mut self, at: usize) {
        if std::mem::replace(&mut self.is_resonant[at], true) {
            return;
        }
        let gain = |place: f64, channel: usize| {
            let omega = place * self.sampling.omega0();
            let receptance = self.system?.receptance(omega).ok()?;
            let unit = self.measured.per_displacement(omega).norm_sqr();
            Some(receptance.row(channel).norm_squared() * unit)
        };
        let line = (self.first + at) as f64;
        let steps = 1..2 * GAINS_PER_LINE;
        let near = steps.map(|step| line - 1.0 + step as f64 / GAINS_PER_LINE as f64);
        let near: Vec<f64> = near.filter(|place| *place > 0.0).collect();
        let around_it: Vec<f64> = around(at, SINUSOID_AROUND, self.is_excluded.len())
            .filter(|row| row.abs_diff(at) > SINUSOID_NEXT)
            .map(|row| (self.first + row) as f64)
            .collect();
        for channel in 0..self.level.ncols() {
            let here = near.iter().filter_map(|place| gain(*place, channel)).sum::<f64>();
            let mut there: Vec<f64> =
                around_it.iter().filter_map(|place| gain(*place, channel)).collect();
            there.sort_by(f64::total_cmp);
            if let Some(median) = there.get(there.len() / 2).filter(|median| **median > 0.0) {
                let raised = here / (near.len() as f64 * median);
                self.level[(at, channel)] *= raised.max(1.0);
            }
        }
    }

    /// Returns the power of a line relative to the level around it, in the channel with the largest
    /// ratio.
    fn power_ratio(&self, windowed: &DMatrix<Complex<f64>>, at: usize) -> f64 {
        let of = |c: usize| windowed[(at, c)].norm_sqr() / self.level[(at, c)];
        (0..windowed.ncols()).map(of).fold(0.0, f64::max)
    }

    /// Returns the largest ratio of the power of a line to the level around it, and the index of
    /// this line. Excluded lines are ignored.
    fn most_conspicuous(&self, windowed: &DMatrix<Complex<f64>>) -> Option<(f64, usize)> {
        let open = (0..self.is_excluded.len()).filter(|at| !self.is_excluded[*at]);
        let ratios = open.map(|at| (self.power_ratio(windowed, at), at));
        ratios.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Returns the sum, over the lines around a line and over all channels, of the power above the
    /// level, relative to the level.
    fn excess(&self, windowed: &DMatrix<Complex<f64>>, at: usize) -> f64 {
        let rows = around(at, SINUSOID_CHECKED_LINES, self.is_excluded.len())
            .filter(|row| self.has_both_neighbours[*row]);
        let of = |row: usize| -> f64 {
            let channels = (0..windowed.ncols()).filter(|c| self.level[(row, *c)].is_finite());
            channels.map(|c| windowed[(row, c)].norm_sqr() / self.level[(row, c)] - 1.0).sum()
        };
        rows.map(of).sum()
    }

    /// Returns the sinusoid that leads to the smallest residual around a line. The frequency of the
    /// sinusoid is between the two neighbours of this line.
    fn fit(&self, windowed: &DMatrix<Complex<f64>>, at: usize) -> Sinusoid {
        let rows = around(at, SINUSOID_FITTED, self.is_excluded.len())
            .filter(|row| self.has_both_neighbours[*row]);
        let rows: Vec<usize> = rows.collect();
        let channels = windowed.ncols();
        let parts = DMatrix::from_fn(2 * rows.len(), channels, |part, c| {
            let z = windowed[(rows[part / 2], c)];
            if part % 2 == 0 { z.re } else { z.im }
        });
        let solved = |place: f64| {
            let omega = place * self.sampling.omega0();
            let qr = self.waves(omega, &rows).qr();
            let along = qr.q().tr_mul(&parts);
            let residual = &parts - qr.q() * &along;
            let cost: f64 = (0..channels)
                .map(|c| residual.column(c).norm_squared() / self.level[(at, c)])
                .sum();
            (cost, omega, qr.r().solve_upper_triangular(&along))
        };
        let cost = |place: f64| solved(place).0;
        let middle = (self.first + at) as f64;
        let step = 2.0 / SINUSOID_FREQUENCIES as f64;
        let tried = (0..=SINUSOID_FREQUENCIES).map(|k| middle - 1.0 + step * k as f64);
        let best = tried.min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(middle);
        let (mut low, mut high) = (best - step, best + step);
        const GOLDEN: f64 = 0.618_033_988_749_895;
        for _ in 0..SINUSOID_SECTIONS {
            let inner = GOLDEN * (high - low);
            if cost(high - inner) < cost(low + inner) {
                high = low + inner;
            } else {
                low = high - inner;
            }
        }
        let (_, omega, amplitude) = solved(0.5 * (low + high));
        let of = |c: usize| match &amplitude {
            Some(both) => Complex::new(both[(0, c)], both[(1, c)]),
            None => Complex::ZERO,
        };
        let line = self.first + at;
        Sinusoid { line, omega, amplitude: (0..channels).map(of).collect() }
    }

    /// Returns the lines, under Hann's window, of a cosine and of a negative sine of amplitude 1;
    /// real and imaginary parts alternate.
    fn waves(&self, omega: f64, rows: &[usize]) -> DMatrix<f64> {
        let mut waves = DMatrix::zeros(2 * rows.len(), 2);
        for (at, row) in rows.iter().enumerate() {
            let line = self.first + row;
            let [[b, a], [before, after], [d, e]] =
                [line - 1, line, line + 1].map(|line| sides(self.sampling, omega, line));
            let (one, other) =
                (before.scale(0.5) - (b + d).scale(0.25), after.scale(0.5) - (a + e).scale(0.25));
            let cosine: Complex<f64> = one + other;
            let sine: Complex<f64> = (one - other) * Complex::i();
            waves
                .view_mut((2 * at, 0), (2, 2))
                .copy_from_slice(&[cosine.re, cosine.im, sine.re, sine.im]);
        }
        waves
    }

    /// Adds a sinusoid to the residual, or subtracts it.
    fn add_scaled(&mut self, sinusoid: &Sinusoid, sign: f64) {
        for row in 0..self.is_excluded.len() {
            for channel in 0..sinusoid.amplitude.len() {
                let read = sinusoid.read(self.sampling, self.first + row, channel);
                self.residual[(row, channel)] += read.scale(sign);
            }
        }
    }
}

fn around(at: usize, reach: usize, count: usize) -> Range<usize> {
    at.saturating_sub(reach)..(at + reach + 1).min(count)
}

/// Returns the lines under Hann's window; the first and the last line are unchanged.
fn hann(lines: &DMatrix<Complex<f64>>) -> DMatrix<Complex<f64>> {
    let mut windowed = lines.clone();
    for row in 1..lines.nrows().saturating_sub(1) {
        let sides = lines.row(row - 1) + lines.row(row + 1);
        windowed.row_mut(row).copy_from(&(lines.row(row).scale(0.5) - sides.scale(0.25)));
    }
    windowed
}

/// Returns, for each line and channel, the mean power that follows from the median power of the
/// lines around this line; infinite if there are too few such lines.
fn levels(windowed: &DMatrix<Complex<f64>>, has_both_neighbours: &[bool]) -> DMatrix<f64> {
    let mut powers = Vec::with_capacity(2 * SINUSOID_AROUND);
    DMatrix::from_fn(windowed.nrows(), windowed.ncols(), |at, channel| {
        if !has_both_neighbours[at] {
            return f64::INFINITY;
        }
        let neighbours = around(at, SINUSOID_AROUND, has_both_neighbours.len());
        let neighbours =
            neighbours.filter(|row| has_both_neighbours[*row] && row.abs_diff(at) > SINUSOID_NEXT);
        powers.clear();
        powers.extend(neighbours.map(|row| windowed[(row, channel)].norm_sqr()));
        if powers.len() < SINUSOID_FEWEST {
            return f64::INFINITY;
        }
        let middle = powers.len() / 2;
        let (_, median, _) = powers.select_nth_unstable_by(middle, f64::total_cmp);
        // The median of an exponential distribution is ln 2 times its mean.
        if *median > 0.0 { *median / LN_2 } else { f64::INFINITY }
    })
}
