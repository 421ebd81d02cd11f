//! Arguments of public functions, drawn from bytes.

use std::fmt::Display;

use arbitrary::Unstructured;
use mechid_model::{InitialState, ResponseQuantity, SecondOrderSystem};
use mechid_signal::{Extent, Record, Sampling};
use nalgebra::{DMatrix, DVector};

use crate::depth::{Depth, reached};

/// Longest message of an error, in bytes.
const LONGEST_MESSAGE: usize = 2_000;

/// Most samples of a record.
const MOST_SAMPLES: usize = 96;

/// Values that follow from the bytes of a case; zeros after the last byte.
pub struct Draw<'a>(Unstructured<'a>);

impl<'a> Draw<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self(Unstructured::new(bytes))
    }

    /// Returns one of the numbers `0..count`.
    pub fn below(&mut self, count: usize) -> usize {
        self.0.int_in_range(0..=count - 1).unwrap_or(0)
    }

    /// Returns true in one of `count` cases.
    pub fn one_in(&mut self, count: usize) -> bool {
        self.below(count) == 1
    }

    pub fn of<T: Clone>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())].clone()
    }

    pub fn seed(&mut self) -> u64 {
        self.0.arbitrary().unwrap_or(0)
    }

    /// Returns a number as in measurements: 10⁻⁴ to 10⁷ in magnitude.
    pub fn ordinary(&mut self) -> f64 {
        let exponent = self.below(12) as i32 - 4;
        let mantissa = 1.0 + f64::from(self.0.arbitrary::<u16>().unwrap_or(0)) / 65536.0 * 9.0;
        let sign = if self.below(4) == 0 { -1.0 } else { 1.0 };
        sign * mantissa * 10f64.powi(exponent)
    }

    /// Returns an ordinary number in most cases, otherwise an extreme or any number.
    pub fn number(&mut self) -> f64 {
        const EDGES: [f64; 16] = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            f64::MIN,
            f64::MIN_POSITIVE,
            5e-324,
            1e150,
            -1e155,
            1e-160,
            1e-300,
            9_007_199_254_740_993.0,
        ];
        match self.below(12) {
            1 | 2 => self.of(&EDGES),
            3 => f64::from_bits(self.seed()),
            _ => self.ordinary(),
        }
    }

    pub fn numbers(&mut self, most: usize) -> Vec<f64> {
        (0..self.below(most + 1)).map(|_| self.number()).collect()
    }

    /// Returns a size: a small one, or one that is too large for any memory.
    pub fn size(&mut self) -> usize {
        match self.below(24) {
            1 => usize::MAX,
            2 => usize::MAX / 2 + 1,
            3 => 1 << 62,
            _ => self.below(20),
        }
    }

    pub fn indices(&mut self, most: usize) -> Vec<usize> {
        (0..self.below(most + 1)).map(|_| self.size()).collect()
    }

    /// Returns spectral lines: in most cases ordered and within a record of `len` samples.
    pub fn lines(&mut self, len: usize) -> Vec<usize> {
        if self.one_in(8) {
            return self.indices(6);
        }
        let (first, step) = (self.below(3), 1 + self.below(3));
        (first..len / 2 + self.below(2)).step_by(step).collect()
    }

    pub fn quantity(&mut self) -> ResponseQuantity {
        self.of(&[
            ResponseQuantity::Displacement,
            ResponseQuantity::Velocity,
            ResponseQuantity::Acceleration,
        ])
    }

    pub fn extent(&mut self) -> Extent {
        self.of(&[Extent::Open, Extent::WholePeriod])
    }

    /// Returns a matrix: in most cases of ordinary numbers.
    pub fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        let hostile = self.one_in(4);
        DMatrix::from_fn(
            rows,
            columns,
            |_, _| if hostile { self.number() } else { self.ordinary() },
        )
    }

    /// Returns a number of degrees of freedom: `of` in most cases, so that arguments match.
    pub fn dof(&mut self, of: usize) -> usize {
        if self.one_in(12) { self.below(5) } else { of }
    }

    pub fn sampling(&mut self) -> Result<Option<Sampling>, String> {
        let dt = if self.one_in(8) { self.number() } else { 1e-3 * (1 + self.below(9)) as f64 };
        let len = if self.one_in(16) { self.size() } else { 1 + self.below(MOST_SAMPLES) };
        // Longer samplings are only constructed; no record is made with them.
        Ok(passed(Sampling::new(dt, len))?.filter(|s| s.len() <= MOST_SAMPLES))
    }

    /// Returns a record; each channel is noise, a sine, a ramp, a constant, or arbitrary numbers.
    pub fn record(
        &mut self,
        sampling: Sampling,
        channels: usize,
    ) -> Result<Option<Record>, String> {
        let len = sampling.len();
        let channels: Vec<Vec<f64>> = (0..channels).map(|_| self.channel(len)).collect();
        let record = passed(Record::from_channels(sampling, &channels))?;
        if record.as_ref().is_some_and(|r| r.data().iter().any(|v| !v.is_finite())) {
            return Err("a record is not finite".into());
        }
        Ok(record)
    }

    fn channel(&mut self, len: usize) -> Vec<f64> {
        let (level, turn) = (self.ordinary(), 0.05 * (1 + self.below(60)) as f64);
        let (kind, mut state) = (self.below(8), self.seed() | 1);
        let mut channel: Vec<f64> = (0..len)
            .map(|k| match kind {
                0 => level,
                1 => level * k as f64,
                2 => level * (turn * k as f64).sin(),
                3 => level * (turn * k as f64).sin() * (-0.05 * k as f64).exp(),
                4 => f64::from(u8::from(k == 3)) * level,
                _ => {
                    // Knuth's linear congruential generator is good enough for the noise.
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    level * ((state >> 33) as f64 / f64::from(1u32 << 31) - 0.5)
                }
            })
            .collect();
        if self.one_in(8) && len > 0 {
            let at = self.below(len);
            channel[at] = self.number();
        }
        channel
    }

    /// Returns a system with ordinary or with arbitrary numbers.
    pub fn system(&mut self, dof: usize) -> Result<Option<SecondOrderSystem>, String> {
        let mut matrices = [0; 3].map(|_| {
            let rows = self.dof(dof);
            self.matrix(rows, rows)
        });
        if !self.one_in(4) {
            // In most machines the diagonals are positive and large.
            for matrix in &mut matrices {
                for i in 0..matrix.nrows() {
                    let row: f64 = matrix.row(i).iter().map(|v| v.abs()).sum();
                    matrix[(i, i)] = row;
                }
            }
        }
        let [mass, damping, stiffness] = matrices;
        passed(SecondOrderSystem::new(mass, damping, stiffness))
    }

    pub fn start(&mut self, dof: usize) -> Result<Option<InitialState>, String> {
        if self.one_in(2) {
            return Ok(Some(InitialState::rest(self.dof(dof))));
        }
        let [x, v] = [0; 2].map(|_| {
            let len = self.dof(dof);
            DVector::from_fn(len, |_, _| self.number())
        });
        passed(InitialState::new(x, v))
    }
}

/// Returns the value, if any, and checks the message of an error.
pub fn passed<T, E: Display>(result: Result<T, E>) -> Result<Option<T>, String> {
    let error = match result {
        Ok(value) => {
            reached(Depth::Fitted);
            return Ok(Some(value));
        }
        Err(error) => error.to_string(),
    };
    reached(Depth::Reached);
    if error.is_empty() || error.contains(char::is_control) || error.len() > LONGEST_MESSAGE {
        return Err(format!("an error has no good message: {error:?}"));
    }
    Ok(None)
}

/// Returns the record, if any; its numbers must be finite.
pub fn finite<E: Display>(record: Result<Record, E>) -> Result<Option<Record>, String> {
    let record = passed(record)?;
    match &record {
        Some(record) if record.data().iter().any(|v| !v.is_finite()) => {
            Err("a result is not finite".into())
        }
        _ => Ok(record),
    }
}
