//! Number of entries in the factors of a sparse matrix.

use nalgebra_sparse::pattern::SparsityPattern;

use crate::sparse::ordering::Graph;

/// Returns the number of entries of L and U of a matrix with this pattern, eliminated in the order
/// `old[new]` without exchanges of rows: two Cholesky factors of the pattern of A + Aᵀ. Exchanges
/// of rows would add entries.
///
/// Row i of the factor L has an entry for each node on the paths that lead from the entries of row
/// i of the matrix up the elimination tree.
///
/// # Source
/// Davis, *Direct Methods for Sparse Linear Systems* (2006), sections 4.1 and 4.2.
pub(super) fn entries(pattern: &SparsityPattern, old: &[usize]) -> u64 {
    const NONE: u32 = u32::MAX;
    let n = old.len();
    let graph = Graph::from_pattern(pattern);
    let mut new = vec![0_u32; n];
    old.iter().enumerate().for_each(|(place, &old)| new[old] = place as u32);
    let (mut parent, mut visited) = (vec![NONE; n], vec![NONE; n]);
    let mut below = 0_u64;
    for (i, &node) in old.iter().enumerate() {
        let row = i as u32;
        visited[i] = row;
        for &neighbour in graph.neighbours(node as u32) {
            let mut at = new[neighbour as usize];
            if at > row {
                continue;
            }
            while visited[at as usize] != row {
                visited[at as usize] = row;
                below += 1;
                if parent[at as usize] == NONE {
                    parent[at as usize] = row;
                }
                at = parent[at as usize];
            }
        }
    }
    2 * below + n as u64
}

#[cfg(test)]
mod tests {
    use mechid_model::{band, triplets};

    use super::*;

    #[test]
    fn the_entries_of_known_factors_are_counted() {
        let natural: Vec<usize> = (0..50).collect();
        // A band fills up between its outermost diagonals.
        let banded = band(50, &[(-4, 1.0), (0, 4.0), (4, 1.0)]);
        assert_eq!(entries(banded.pattern(), &natural), 50 + 2 * 46);
        let banded = band(50, &[(-3, 1.0), (-1, 1.0), (0, 4.0), (1, 1.0), (3, 1.0)]);
        // All entries of the band become non-zero except (2, 0).
        assert_eq!(entries(banded.pattern(), &natural), 50 + 2 * (49 + 48 + 47 - 1));
        // A star: if its centre is eliminated first, all other nodes become coupled to one another;
        // if it is eliminated last, no entry is added.
        let star = (1..50).flat_map(|i| [(0, i, 1.0), (i, 0, 1.0), (i, i, 2.0)]);
        let star = triplets(50, star.chain([(0, 0, 60.0)])).unwrap();
        assert_eq!(entries(star.pattern(), &natural), 50 * 50);
        let last: Vec<usize> = (1..50).chain([0]).collect();
        assert_eq!(entries(star.pattern(), &last), 50 + 2 * 49);
    }
}
