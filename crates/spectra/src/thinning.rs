//! Thinning of data: one of every n rows is used.

/// Fractional part of the golden ratio; its multiples, modulo 1, are spread evenly and without a
/// period.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Returns one of every `step` rows of `len`, in ascending order; none for a step of 0. The
/// position of the chosen row within its step changes without a period, because a force may act
/// only on every second row.
///
/// # Source
/// Weyl (1916), Mathematische Annalen 77, 313–352 (multiples of an irrational number are spread
/// evenly).
///
/// ```
/// assert_eq!(mechid_spectra::thinning::thinned_rows(10, 5), [0, 8]);
/// ```
pub fn thinned_rows(len: usize, step: usize) -> Vec<usize> {
    let groups = (0..len).step_by(step.max(1)).take_while(|_| step > 0);
    let row = |(group, first): (usize, usize)| {
        let size = step.min(len - first);
        first + ((GOLDEN * group as f64).fract() * size as f64) as usize
    };
    groups.enumerate().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_force_of_interleaved_rows_keeps_its_share() {
        for step in [2, 4, 10] {
            let rows = thinned_rows(1000, step);
            assert_eq!(rows.len(), 1000 / step);
            assert!(rows.windows(2).all(|pair| pair[0] < pair[1]));
            let odd = rows.iter().filter(|row| *row % 2 == 1).count();
            assert!((0.4..0.6).contains(&(odd as f64 / rows.len() as f64)), "{step}: {odd}");
        }
        assert_eq!(thinned_rows(5, 1), [0, 1, 2, 3, 4]);
        assert!(thinned_rows(5, 0).is_empty());
    }
}
