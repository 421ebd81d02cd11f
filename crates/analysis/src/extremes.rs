//! Minima and maxima of sections of a long window, for plots.

/// Number of sections of a long window in a plot: several for each column of pixels.
const CELLS: usize = 4096;

/// Smallest and largest sample of each section of a window, in the unit of the channel.
#[derive(Debug, Clone)]
pub struct Extremes {
    cell: usize,
    samples: usize,
    /// Smallest and largest sample of every section: each has the index, counted from 0, and the
    /// value.
    extremes: Vec<[(usize, f64); 2]>,
}

impl Extremes {
    /// Creates empty extremes for a window of `window` samples.
    pub(crate) fn new(window: usize) -> Self {
        Self { cell: window.div_ceil(CELLS).max(1), samples: 0, extremes: Vec::new() }
    }

    /// Adds the next samples.
    pub(crate) fn push(&mut self, values: &[f64]) {
        for point in (self.samples..).zip(values.iter().copied()) {
            match self.extremes.get_mut(point.0 / self.cell) {
                None => self.extremes.push([point; 2]),
                Some([least, _]) if point.1 < least.1 => *least = point,
                Some([_, largest]) if point.1 > largest.1 => *largest = point,
                Some(_) => {}
            }
        }
        self.samples += values.len();
    }

    /// Returns the index (counted from 0) and the value of the smallest and of the largest sample
    /// of each section, in the order of time.
    pub fn points(&self) -> impl Iterator<Item = (usize, f64)> {
        self.extremes.iter().flat_map(|cell| {
            let mut cell = *cell;
            cell.sort_by_key(|(sample, _)| *sample);
            let points = if cell[0].0 == cell[1].0 { 1 } else { 2 };
            cell.into_iter().take(points)
        })
    }
}
